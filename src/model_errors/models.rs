//! The renderer's models as functions of two sites.

use super::scenes::Scene;
use crate::curvature::{balance, of_mesh, reach};
use crate::reference::boundary::{Side, diffuse_reflectance};
use crate::reference::profile::table::Local;
use crate::reference::profile::{self, Coefficients, Directional, Options, Profile, constant};
use crate::reference::walk::Matter;
use crate::reference::walk::mesh::Corners;
use crate::reference::walk::model::Transfer;
use crate::reference::walk::shape::Site;
use crate::settings::{Model, Normalisation};
use crate::shared::{self, MODEL_LAMBERT, MODEL_TABLE};
use crate::table::SPHERES;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// Directions from which a locally alike sphere is measured.
const DIRECTIONS: usize = 64;

/// A model with its name.
pub type Named = (&'static str, Box<dyn Transfer>);

/// Every model of the renderer for this matter; the tabulated one also with the locally alike spheres of a body.
pub fn models(matter: &Matter, scene: Option<&Scene>) -> Vec<Named> {
    let coefficients = Coefficients {
        sigma_s_prime: matter.sigma_s_prime(),
        sigma_a: matter.sigma_a,
        g: matter.g,
        ior: matter.ior,
        rough: None,
        appearance: None,
    };
    let transfer = |&(model, name): &(Model, &'static str)| -> Option<Named> {
        let constant = constant(model).filter(|&constant| constant != MODEL_LAMBERT)?;
        if constant == MODEL_TABLE {
            return Some((name, Box::new(Table::new(&coefficients, Vec::new()))));
        }
        let transfer: Box<dyn Transfer> = match Profile::new(constant, &coefficients) {
            Profile::Directional(directional) => {
                let leaving = PI * (1.0 - diffuse_reflectance(matter.ior, Side::Outside));
                Box::new(Beam { directional, leaving })
            }
            profile => Box::new(move |r: f64| profile.rd(r)),
        };
        Some((name, transfer))
    };
    let mut all: Vec<Named> = Model::NAMES.iter().filter_map(transfer).collect();
    all.push(("table on spheres", Box::new(Table::on(scene, &coefficients, 1.0 / (3.0 * matter.sigma_a).sqrt()))));
    all
}

/// The directional dipole.
struct Beam {
    directional: Directional,
    /// pi (1 - rho_e): exitance over S.
    leaving: f64,
}

impl Transfer for Beam {
    fn transfer(&self, from: &Site, travel: DVec3, to: &Site) -> f64 {
        self.leaving * self.directional.value(to.position - from.position, from.normal, -travel, to.normal, 0.0)
    }
}

/// The tabulated profile, by its kernels' twin.
struct Table {
    material: shared::Material,
    numbers: Vec<Vec3>,
    strength: f64,
    /// 1 / radius at each place; empty for half-spaces.
    curvatures: Vec<f64>,
    /// Balance at each place of a mesh.
    balances: Vec<f64>,
}

impl Table {
    /// The table with the locally alike spheres of a body; lengths are in reduced mean free paths.
    fn on(scene: Option<&Scene>, matter: &Coefficients, diffuse: f64) -> Table {
        let mesh = match scene.map(|scene| &scene.figure) {
            None => return Table::new(matter, vec![0.0]),
            Some(super::Figure::Ball(ball)) => return Table::new(matter, vec![1.0 / ball.radius]),
            Some(super::Figure::Mesh(mesh)) => mesh,
        };
        let corners: Vec<Corners> = (0..mesh.len()).map(|index| mesh.corners(index)).collect();
        let curvatures = of_mesh(&corners, reach(diffuse, 1.0), DIRECTIONS);
        let means = curvatures.iter().map(|at| f64::from(at.element_sum()) / 3.0).collect();
        let mut table = Table::new(matter, means);
        let local = |curvature: f64| Local::new(table.matter(curvature));
        let balances = balance::of_mesh(&corners, &curvatures, false, diffuse, local);
        table.balances = balances.iter().map(|at| at.iter().map(|at| f64::from(at.x)).sum::<f64>() / 3.0).collect();
        table
    }

    fn matter(&self, curvature: f64) -> profile::Matter<'_> {
        profile::Matter { material: &self.material, tables: &self.numbers, curvature }
    }

    fn new(matter: &Coefficients, curvatures: Vec<f64>) -> Table {
        let mut numbers = Vec::new();
        let options = Options {
            normalisation: Normalisation::Energy,
            radius_tail: 0.0,
            directional: Default::default(),
            precision: Default::default(),
        };
        let spheres: &[i32] = if curvatures.is_empty() { &[] } else { &SPHERES };
        let material = profile::tabulated(&[*matter; 3], options, spheres, &mut numbers);
        let strength = Profile::new(MODEL_TABLE, matter).strength();
        Table { material, numbers, strength, curvatures, balances: vec![] }
    }
}

impl Transfer for Table {
    fn transfer(&self, from: &Site, travel: DVec3, to: &Site) -> f64 {
        let matter = self.matter(self.curvatures.get(to.place).copied().unwrap_or(0.0));
        let balance = self.balances.get(to.place).copied().unwrap_or(1.0);
        let cos = (-travel.dot(from.normal)).max(0.0);
        let shape = profile::shapes(matter, from.position.distance(to.position)).x;
        self.strength * balance * shape * profile::obliqueness(matter, cos, false).x
    }
}
