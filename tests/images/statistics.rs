//! The variance that an image states is the one it has.

use crate::{channel, device, scenes::standard};
use translucent::{Renderer, Scene, Settings};

const SEEDS: u32 = 64;

#[test]
fn stated_variance_is_the_spread_over_seeds() {
    let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo.gltf")).expect("the shipped scene loads");
    let settings = Settings { resolution: Some((20, 20)), ..standard() };
    let device = device();
    let mut renderer = Renderer::new(&device, &scene, &settings).expect("the renderer is made");
    let mut image = |seed, samples| {
        renderer.reseed(seed).expect("the seed is set");
        renderer.render(samples).expect("renders");
        renderer.image().expect("the image is there")
    };
    // 19 samples: batches of unequal size.
    for samples in [8, 19, 64] {
        let images: Vec<_> = (0..SEEDS).map(|seed| image(seed, samples)).collect();
        for name in ["R", "G", "B"] {
            let values: Vec<_> = images.iter().map(|i| channel(i, &format!("subsurface.{name}"))).collect();
            let stated: Vec<_> = images.iter().map(|i| channel(i, &format!("variance.{name}"))).collect();
            // Sums over pixels of the spread between seeds and of the mean stated variance.
            let n = f64::from(SEEDS);
            let (mut spread, mut mean_stated) = (0.0, 0.0);
            // By seed, for the standard error of the difference.
            let mut differences = vec![0.0; SEEDS as usize];
            for pixel in 0..400 {
                let mean = values.iter().map(|v| f64::from(v[pixel])).sum::<f64>() / n;
                for seed in 0..SEEDS as usize {
                    let deviation = (f64::from(values[seed][pixel]) - mean).powi(2) * n / (n - 1.0);
                    spread += deviation / n;
                    mean_stated += f64::from(stated[seed][pixel]) / n;
                    differences[seed] += deviation - f64::from(stated[seed][pixel]);
                }
            }
            let (difference, error) = crate::mean_and_error(&differences);
            assert!(
                difference.abs() < 4.0 * error,
                "{samples} samples, {name}: spread {spread:.3e}, stated {mean_stated:.3e}, +- {error:.1e}"
            );
            // Force of the test: an error of a factor 1.5 is seen. The within-sequence estimate is 16 times off.
            assert!(error * 4.0 < 0.5 * mean_stated, "{samples} samples, {name}: +- {error:.1e} of {mean_stated:.1e}");
        }
    }
}
