//! Light that the first surface reflects or emits: twin of `reflect.comp`.
//!
//! Translucent matter has a dielectric GGX surface, f = F(h.wo) D G2 / (4 cos cos); without roughness it is a mirror of
//! the environment alone. Opaque matter is the metallic-roughness model of glTF 2.0, appendix B: the same lobe with
//! Schlick's F from F0 = mix(((n-1)/(n+1))^2, colour, metallic), over (1 - F)(1 - metallic) colour / pi.
//!
//! Directions come from several densities, chosen by an interval of u1 and combined by the balance heuristic: visible
//! normals, the cosine (opaque matter), the environment's image. What emits is also found by points drawn on it; see
//! [`emitter`].

use super::accumulate::{from_direction, from_emitter, lifted, visibility};
use super::boundary::{ggx, schlick, smith_g2, visible_normal, visible_normal_pdf};
use super::light::{self, FAR};
use super::math::{basis, cosine_direction, from_local};
use super::pixel::position;
use super::primary::camera_ray;
use super::projection::{Seen, material, seen};
use super::sums::Contribution;
use super::tile::{Place, direction_point};
use super::{Inputs, boundary, emitter, intersect, texture};
use crate::shared::{
    DIM_EMITTER_REFLECT, DIM_REFLECT, ENVIRONMENT_IMAGE, MISS, Material, OPAQUE_ALPHA_MIN, Step, Surface, TRANSLUCENT,
    TWO_SIDED,
};
use glam::DVec3;
use std::f64::consts::PI;

/// What the first surface of pixel `index` of the band reflects and emits, in the step's rays.
pub fn reflect(inputs: &Inputs, step: &Step, index: u32, surface: &Surface) -> Contribution {
    if surface.triangle == MISS {
        let shown = step.first != 0 && inputs.view.show_environment != 0;
        let direction = camera_ray(&inputs.features, inputs.view, step, index).direction;
        return Contribution::of(if shown { light::environment(inputs, direction) } else { DVec3::ZERO });
    }
    let seen = seen(inputs, surface);
    let material =
        texture::surface(inputs, material(inputs, surface), surface.triangle, surface.barycentric.as_dvec2());
    let lobe = Lobe::new(&material, &seen);
    let shines = step.first != 0 && (seen.side > 0.0 || lobe.material.flags & TWO_SIDED != 0);
    let emitted = if shines { lobe.material.emission.as_dvec3() } else { DVec3::ZERO };
    let rays = step.ray_begin..step.ray_begin + step.ray_count;
    let reflected: DVec3 = rays.map(|k| ray(inputs, step, index, surface, &seen, &lobe, k)).sum();
    Contribution::of(emitted + reflected)
}

fn ray(inputs: &Inputs, step: &Step, index: u32, surface: &Surface, seen: &Seen, lobe: &Lobe, k: u32) -> DVec3 {
    let point = surface.position.as_dvec3();
    let cosine = |wi: DVec3| if seen.normal.dot(wi) > 0.0 { lobe.normal.dot(wi).max(0.0) } else { 0.0 };
    // Positions round as the vertices do, and opaque surfaces may reach far beyond the unit ball.
    let triangle = &inputs.triangles[surface.triangle as usize];
    let extent = triangle.vertices.iter().fold(1.0, |extent: f32, vertex| extent.max(vertex.abs().max_element()));
    let origin = lifted(point, seen.normal * f64::from(extent));
    let directions = f64::from(inputs.view.directions);

    if let Some(light) = inputs.lights.get(k as usize) {
        let incident = light::delta(light, point);
        let cosine = cosine(incident.wi);
        if lobe.is_mirror() || cosine <= 0.0 {
            return DVec3::ZERO;
        }
        let visible = visibility(inputs, origin, incident.wi, incident.distance);
        return lobe.scattering(incident.wi) * cosine * incident.irradiance * visible;
    }
    let j = k - inputs.view.light_count;
    if lobe.is_mirror() {
        let wi = 2.0 * lobe.cos_o * lobe.normal - lobe.wo;
        if j > 0 || cosine(wi) <= 0.0 {
            return DVec3::ZERO;
        }
        let reflectance = fresnel_outside(lobe.material.ior.into(), lobe.cos_o);
        let arriving = match intersect::closest(inputs, origin, wi, 0.0, FAR) {
            Some(hit) => emitter::radiance(inputs, hit.triangle, hit.barycentric, wi),
            None => light::environment(inputs, wi),
        };
        return reflectance * arriving;
    }
    let place = Place::alone(position(inputs.view, step, index));
    let points = f64::from(inputs.features.emitters);
    let mut sum = DVec3::ZERO;
    if inputs.features.emitters != 0 {
        let (u1, u2) = direction_point(inputs, step, place, j, DIM_EMITTER_REFLECT);
        let drawn = emitter::draw(inputs, origin, u1, u2);
        let cosine = cosine(drawn.wi);
        if cosine > 0.0 {
            let light = from_emitter(inputs, origin, &drawn, points, lobe.direction_pdf(inputs, drawn.wi));
            sum += lobe.scattering(drawn.wi) * cosine * light / directions;
        }
    }
    let (u1, u2) = direction_point(inputs, step, place, j, DIM_REFLECT);
    let wi = lobe.direction(inputs, u1, u2);
    let pdf = lobe.direction_pdf(inputs, wi);
    let cosine = cosine(wi);
    if cosine > 0.0 && pdf > 0.0 {
        sum += lobe.scattering(wi) * cosine * from_direction(inputs, origin, wi, points, pdf) / directions;
    }
    sum
}

fn fresnel_outside(ior: f64, cos: f64) -> f64 {
    1.0 - boundary::transmittance(ior, cos)
}

/// The surface's scattering at a point, and the densities of its directions.
struct Lobe<'a> {
    material: &'a Material,
    normal: DVec3,
    wo: DVec3,
    cos_o: f64,
    alpha: f64,
    translucent: bool,
}

impl<'a> Lobe<'a> {
    fn new(material: &'a Material, seen: &Seen) -> Lobe<'a> {
        let translucent = material.flags & TRANSLUCENT != 0;
        let least = if translucent { 0.0 } else { OPAQUE_ALPHA_MIN };
        Lobe {
            material,
            normal: seen.shading_normal,
            wo: seen.wo,
            cos_o: seen.shading_normal.dot(seen.wo),
            alpha: material.alpha.max(least).into(),
            translucent,
        }
    }

    fn is_mirror(&self) -> bool {
        self.alpha == 0.0
    }

    /// f(wi, wo) for wi above the surface.
    fn scattering(&self, wi: DVec3) -> DVec3 {
        let half = (self.wo + wi).normalize();
        let cos_i = self.normal.dot(wi);
        let specular = ggx(self.alpha, self.normal.dot(half)) * smith_g2(self.alpha, self.cos_o, cos_i)
            / (4.0 * self.cos_o * cos_i);
        let ior = f64::from(self.material.ior);
        let cos_h = half.dot(self.wo);
        if self.translucent {
            return DVec3::splat(fresnel_outside(ior, cos_h) * specular);
        }
        let (color, metallic) = (self.material.base_color.as_dvec3(), f64::from(self.material.metallic));
        let f0 = DVec3::splat(((ior - 1.0) / (ior + 1.0)).powi(2)).lerp(color, metallic);
        let reflectance = schlick(f0, cos_h);
        reflectance * specular + (DVec3::ONE - reflectance) * (1.0 - metallic) * color / PI
    }

    fn visible_normal_direction(&self, u1: f64, u2: f64) -> DVec3 {
        let (t, b) = basis(self.normal);
        let wo = DVec3::new(self.wo.dot(t), self.wo.dot(b), self.cos_o);
        let half = from_local(self.normal, visible_normal(self.alpha, wo, u1, u2));
        2.0 * self.wo.dot(half) * half - self.wo
    }

    /// Shares of image, visible normals and cosine, in the order of the intervals of u1.
    fn shares(&self, inputs: &Inputs) -> [f64; 3] {
        let image = if inputs.features.environment == ENVIRONMENT_IMAGE { 0.5 } else { 0.0 };
        let cosine = if self.translucent { 0.0 } else { (1.0 - image) / 2.0 };
        [image, 1.0 - image - cosine, cosine]
    }

    /// A direction from which light may come.
    fn direction(&self, inputs: &Inputs, u1: f64, u2: f64) -> DVec3 {
        let [image, visible, cosine] = self.shares(inputs);
        if u1 < image {
            light::sample_environment(inputs, u1 / image, u2)
        } else if u1 < image + visible {
            self.visible_normal_direction((u1 - image) / visible, u2)
        } else {
            cosine_direction(self.normal, (u1 - image - visible) / cosine, u2)
        }
    }

    /// The density of [`Lobe::direction`].
    fn direction_pdf(&self, inputs: &Inputs, wi: DVec3) -> f64 {
        let [image, visible, cosine] = self.shares(inputs);
        let half = (self.wo + wi).normalize();
        let mut pdf = visible * visible_normal_pdf(self.alpha, self.cos_o, self.normal.dot(half))
            + cosine * self.normal.dot(wi).max(0.0) / PI;
        if image > 0.0 {
            pdf += image * light::environment_pdf(inputs, wi);
        }
        pdf
    }
}
