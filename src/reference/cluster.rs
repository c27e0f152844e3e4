//! A node of the cloud's tree: twin of `cluster.comp`.
//!
//! What points below a node have in common is their flux, as if it entered at their mean position. With flux as weight the
//! error of a profile's first order cancels (J. Barnes, P. Hut, Nature 324 (1986); H. W. Jensen, J. Buhler, ACM TOG 21
//! (2002)); that of the second is made up for with the spread of the points, the mean square of their distance from there.

use crate::shared::{Cluster, SEVERAL};

/// The node above two others, of which the second may be empty.
pub fn cluster(a: &Cluster, b: &Cluster) -> Cluster {
    if b.area == 0.0 {
        return *a;
    }
    let flux = |cluster: &Cluster| cluster.flux.as_dvec3().element_sum();
    let dark = flux(a) + flux(b) == 0.0;
    let weight = |cluster: &Cluster| if dark { f64::from(cluster.area) } else { flux(cluster) };
    let place = |cluster: &Cluster| cluster.position.as_dvec3();
    let position = (place(a) * weight(a) + place(b) * weight(b)) / (weight(a) + weight(b));
    let normal = a.normal.as_dvec3() * weight(a) + b.normal.as_dvec3() * weight(b);
    let squared =
        |cluster: &Cluster| weight(cluster) * (f64::from(cluster.spread) + position.distance_squared(place(cluster)));
    let extent = |cluster: &Cluster| position.distance(place(cluster)) + f64::from(cluster.radius);
    let sum = |a: glam::Vec3, b: glam::Vec3| (a.as_dvec3() + b.as_dvec3()).as_vec3();
    Cluster {
        position: position.as_vec3(),
        radius: extent(a).max(extent(b)) as f32,
        normal: normal.normalize_or_zero().as_vec3(),
        spread: ((squared(a) + squared(b)) / (weight(a) + weight(b))) as f32,
        flux: sum(a.flux, b.flux),
        oblique: sum(a.oblique, b.oblique),
        area: a.area + b.area,
        mass: sum(a.mass, b.mass),
        set: if a.set == b.set { a.set } else { SEVERAL },
        ..*a
    }
}

/// Makes all nodes above the leaves, the second half of `clusters`.
pub fn grow(clusters: &mut [Cluster]) {
    for node in (1..clusters.len() / 2).rev() {
        clusters[node] = cluster(&clusters[2 * node], &clusters[2 * node + 1]);
    }
}
