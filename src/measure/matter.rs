//! The matter that is measured, as a scene file would hold it.

use super::{MM, scenes};
use crate::{
    error::{Error, Result},
    model::{self, Detail},
    reference::{
        boundary::{Side, diffuse_reflectance, transmittance},
        profile::{self, Coefficients, Profile},
        walk,
    },
    scene::{LengthKind, LoadOptions, Medium, Scene},
    settings::{Model, Settings},
};
use glam::DVec3;
use serde_json::{Value, json};

/// Scattering matter and its closed forms.
#[derive(Clone, Debug)]
pub struct Matter {
    /// What it is called in titles.
    pub name: String,
    /// The material as glTF.
    pub material: Value,
    /// As the scene module reads it.
    pub medium: Medium,
    pub ior: f64,
    /// The model of its profile.
    pub model: Model,
    constant: u32,
}

impl Matter {
    /// From the contents of `extras.bssrdf`, with a model other than what those ask for unless it is [`Model::Auto`].
    ///
    /// # Errors
    /// As loading a file with that material, and for the opaque limit, which has no profile.
    pub fn new(name: &str, bssrdf: Value, model: Model) -> Result<Matter> {
        let mut bssrdf = bssrdf;
        bssrdf["surface"] = json!("smooth");
        let material = json!({"name": name, "extras": {"bssrdf": bssrdf}});
        let mut mesh = scenes::Mesh::default();
        mesh.quad(DVec3::ZERO, DVec3::X, DVec3::Y);
        let eye = scenes::Eye { eye: DVec3::Z, at: DVec3::ZERO, lens: 1.0 };
        let file = scenes::gltf(&[(mesh, 0)], std::slice::from_ref(&material), &[], &eye);
        let mut scene = Scene::from_bytes(name, file.to_string().as_bytes(), &LoadOptions::default())?;
        let read = scene.materials.remove(0);
        let medium = read.medium.clone().expect("a material with extras.bssrdf has a medium");
        if medium.sigma_s_prime.min_element() <= 0.0 {
            return Err(Error::setting("matter", "must scatter in every channel to be measured"));
        }
        let settings = Settings { model, reuse: Some(1), ..Settings::default() };
        let model = model::advise(&settings, &read, Detail::ALL, None).expect("it has a medium").choice.model;
        if model == Model::Lambert {
            return Err(Error::setting("model", "the opaque limit has no profile that could be measured"));
        }
        let constant = profile::constant(model).expect("a choice is a built model");
        Ok(Matter { name: name.into(), material, medium, ior: read.ior, model, constant })
    }

    /// Matter that has the properties of one channel in all three.
    pub fn grey(&self, channel: usize) -> Matter {
        let mut grey = self.clone();
        let medium = &mut grey.medium;
        for coefficient in [&mut medium.sigma_s_prime, &mut medium.sigma_a, &mut medium.g] {
            *coefficient = DVec3::splat(coefficient[channel]);
        }
        let mut bssrdf = json!({"g": medium.g.to_array(), "ior": self.ior, "surface": "smooth"});
        if let Some(appearance) = &mut medium.appearance {
            appearance.albedo = DVec3::splat(appearance.albedo[channel]);
            appearance.length = DVec3::splat(appearance.length[channel]);
            let length = match appearance.kind {
                LengthKind::MeanFreePath => "mean_free_path",
                LengthKind::DiffuseMeanFreePath => "diffuse_mean_free_path",
            };
            bssrdf["albedo"] = json!(appearance.albedo.to_array());
            bssrdf[length] = json!(appearance.length.to_array());
            bssrdf["unit"] = "m".into();
        } else {
            bssrdf["sigma_s_prime"] = json!(medium.sigma_s_prime.to_array());
            bssrdf["sigma_a"] = json!(medium.sigma_a.to_array());
            bssrdf["unit"] = "1/m".into();
        }
        grey.material["extras"]["bssrdf"] = bssrdf;
        grey
    }

    /// The channels that differ: all three, or the green one of grey matter.
    pub fn channels(&self) -> Vec<usize> {
        let same = |v: DVec3| v == DVec3::splat(v.x);
        let grey = same(self.medium.sigma_s_prime) && same(self.medium.sigma_a) && same(self.medium.g);
        if grey { vec![1] } else { vec![0, 1, 2] }
    }

    /// The closed forms of a channel, lengths in mm.
    pub fn profile(&self, channel: usize) -> Profile {
        Profile::new(self.constant, &Coefficients::of(&self.medium, self.ior, channel).in_units(1.0 / MM))
    }

    /// What a channel sends out within a radius (mm) of a perpendicular beam, per flux that entered.
    pub fn beam(&self, channel: usize) -> Box<dyn Fn(f64) -> f64> {
        let coefficients = Coefficients::of(&self.medium, self.ior, channel).in_units(1.0 / MM);
        model::beam(self.model, &coefficients).expect("the model was found when the matter was made")
    }

    /// 1 / sigma_t' of each channel (mm).
    pub fn mean_free_path(&self) -> DVec3 {
        1.0 / (self.medium.sigma_s_prime + self.medium.sigma_a) / MM
    }

    /// Half the side of a body that stands for a half-space (mm): beyond it lies a millionth of the light, or less than
    /// [`Matter::lost`] where a profile without absorption reaches farther than kernels can see.
    pub fn reach(&self) -> f64 {
        let reach = (0..3).map(|c| self.profile(c).radius_beyond(1e-6)).fold(0.0, f64::max);
        reach.min(1e4 * self.mean_free_path().min_element())
    }

    /// Largest share of a channel's light beyond the reach.
    pub fn lost(&self) -> f64 {
        let reach = self.reach();
        (0..3).map(|c| 1.0 - self.profile(c).cdf(reach) / self.profile(c).total()).fold(0.0, f64::max)
    }

    /// A channel as the random walk takes it, lengths in mm.
    pub fn walk(&self, channel: usize) -> walk::Matter {
        let g = self.medium.g[channel];
        walk::Matter {
            sigma_s: self.medium.sigma_s_prime[channel] * MM / (1.0 - g),
            sigma_a: self.medium.sigma_a[channel] * MM,
            g,
            ior: self.ior,
        }
    }

    /// Ft at the cosine outside.
    pub fn transmittance(&self, cosine: f64) -> f64 {
        transmittance(self.ior, cosine)
    }

    /// Radiance along the normal per unit of exitance: Ft / (pi (1 - rho_e)).
    pub fn leaving(&self) -> f64 {
        self.transmittance(1.0) / (std::f64::consts::PI * (1.0 - diffuse_reflectance(self.ior, Side::Outside)))
    }
}
