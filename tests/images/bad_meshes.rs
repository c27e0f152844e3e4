//! Meshes that bound no body, or are wound wrongly: no sample is invalid, as `render` checks, and where there is a body,
//! it looks as it should.

use crate::{
    channel, render,
    scenes::{Eye, Mesh, gltf, matter, scene, sun},
};
use glam::DVec3;
use translucent::{Model, Scene, Settings};

/// The mesh in matter whose light comes out within a tenth of a ball's radius, lit and seen from +z.
fn look(mesh: &Mesh) -> (Scene, Vec<f64>) {
    let eye = Eye { eye: DVec3::new(0.0, 0.0, 10.0), at: DVec3::ZERO, lens: -1.6 };
    let light = (sun(), DVec3::new(1.0, 2.0, 5.0), DVec3::ZERO);
    let scene = scene(&gltf(&[(mesh.clone(), 0)], &[matter([36.0; 3], [4.0; 3], 1.3)], &[light], &eye));
    let settings = Settings { resolution: Some((SIDE, SIDE)), seed: 5, model: Model::Standard, ..Settings::default() };
    let image = render(&scene, &settings, 32);
    assert!(image.channels.iter().all(|channel| channel.data.iter().all(|x| x.is_finite())));
    let light: Vec<f64> = channel(&image, "subsurface.G").iter().map(|x| f64::from(*x)).collect();
    assert!(light.iter().all(|x| *x >= 0.0) && light.iter().sum::<f64>() > 1.0);
    (scene, light)
}

const SIDE: u32 = 24;

/// Fails if the images differ by more than `share` of their light in the columns.
#[track_caller]
fn assert_alike(what: &str, a: &[f64], b: &[f64], columns: std::ops::Range<usize>, share: f64) {
    let inside = |i: &usize| columns.contains(&(i % SIDE as usize));
    let total: f64 = (0..a.len()).filter(inside).map(|i| a[i]).sum();
    let difference: f64 = (0..a.len()).filter(inside).map(|i| (a[i] - b[i]).abs()).sum();
    assert!(total > 0.2 && difference <= share * total, "{what}: {difference} of {total}");
}

/// Keeps the triangles that `keep` says, by number and middle.
fn without(mesh: &Mesh, keep: impl Fn(usize, DVec3) -> bool) -> Mesh {
    let middle = |t: &[u32]| t.iter().map(|i| mesh.positions[*i as usize]).sum::<DVec3>() / 3.0;
    let kept = mesh.indices.chunks_exact(3).enumerate().filter(|(i, t)| keep(*i, middle(t)));
    Mesh { indices: kept.flat_map(|(_, t)| t.to_vec()).collect(), ..mesh.clone() }
}

#[test]
fn bad_meshes_have_finite_and_documented_images() {
    let ball = Mesh::sphere(1.0, 8);
    let (closed, expected) = look(&ball);
    assert_eq!((closed.sets[0].open_edges, closed.sets[0].crowded_edges), (0, 0));
    let all = 0..SIDE as usize;

    // Open at the back: matter goes on behind the border, and what is far from it does not know.
    let (scene, found) = look(&without(&ball, |_, middle| middle.z > -0.6));
    assert!(scene.sets[0].open_edges > 0);
    assert_alike("open", &expected, &found, all.clone(), 1e-3);

    // Holes everywhere, as eyes and mouths have them: less light, but light.
    let (scene, found) = look(&without(&ball, |i, _| i % 7 != 0));
    assert!(scene.sets[0].open_edges > 100);
    let share = found.iter().sum::<f64>() / expected.iter().sum::<f64>();
    assert!(share > 0.6 && share < 1.1, "{share}");

    // Each triangle twice: one of the two is dropped.
    let mut twice = ball.clone();
    twice.indices.extend(ball.indices.iter());
    let (scene, found) = look(&twice);
    assert_eq!(scene.triangles.len(), closed.triangles.len());
    assert_alike("twice", &expected, &found, all.clone(), 1e-5);

    // Double-sided, by triangles of either winding: each is lit from its own side, so the other samples have one mean.
    let mut doubled = ball.clone();
    doubled.indices.extend(ball.indices.chunks_exact(3).flat_map(|t| [t[0], t[2], t[1]]));
    let (scene, found) = look(&doubled);
    assert!(scene.sets[0].crowded_edges > 100);
    let share = found.iter().sum::<f64>() / expected.iter().sum::<f64>();
    assert!((share - 1.0).abs() < 0.02, "{share}");

    // All or some wound the other way: turned.
    for (what, every) in [("inverted", 1), ("partly inverted", 3)] {
        let mut turned = ball.clone();
        turned.indices.chunks_exact_mut(3).step_by(every).for_each(|t| t.swap(1, 2));
        let (scene, found) = look(&turned);
        assert!(scene.warnings.iter().any(|warning| warning.contains("turned")), "{what}: {:?}", scene.warnings);
        // Vertices come in another order, and with them roundings.
        assert_alike(what, &expected, &found, all.clone(), 1e-3);
    }

    // Two balls through each other, as one mesh: far from where they meet each is itself.
    let mut both = ball.clone();
    let first = both.positions.len() as u32;
    both.positions.extend(ball.positions.iter().map(|p| *p + DVec3::X * 1.3));
    both.normals.extend(&ball.normals);
    both.indices.extend(ball.indices.iter().map(|i| i + first));
    let (_, found) = look(&both);
    assert_alike("intersecting", &expected, &found, 0..9, 1e-3);

    // A ball with a fin: an edge of three triangles.
    let mut finned = ball.clone();
    let [a, b] = [finned.indices[0], finned.indices[1]];
    let tip = 1.4 * finned.positions[a as usize];
    finned.indices.extend([a, b, finned.positions.len() as u32]);
    finned.positions.push(tip);
    finned.normals.push(tip.cross(finned.positions[b as usize]).normalize());
    let (scene, found) = look(&finned);
    assert!(scene.sets[0].crowded_edges > 0);
    let changed = expected.iter().zip(&found).filter(|(a, b)| (*a - *b).abs() > 0.1 * *a).count();
    assert!(changed < expected.len() / 4, "{changed}");
}
