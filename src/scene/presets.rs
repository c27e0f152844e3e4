//! Measured materials by name: Jensen et al. 2001 and Narasimhan et al. 2006.

use glam::DVec3;

/// A named material, as its table gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preset {
    pub name: &'static str,
    /// Reduced scattering coefficient [1/mm].
    pub sigma_s_prime: DVec3,
    /// Absorption coefficient [1/mm].
    pub sigma_a: DVec3,
    /// Mean cosine of the phase function; 0 where the table gives none.
    pub g: DVec3,
    /// Index of refraction.
    pub ior: f64,
    /// The paper.
    pub source: &'static str,
}

const JENSEN: &str = "Jensen et al. 2001";
const NARASIMHAN: &str = "Narasimhan et al. 2006";

/// Index of refraction of the diluted liquids: that of water.
const NARASIMHAN_IOR: f64 = 1.33;

/// Every named material, in the order of its table.
pub fn presets() -> Vec<Preset> {
    let jensen = JENSEN_TABLE.iter().map(|&(name, sigma_s_prime, sigma_a, ior)| Preset {
        name,
        sigma_s_prime: DVec3::from_array(sigma_s_prime),
        sigma_a: DVec3::from_array(sigma_a),
        g: DVec3::ZERO,
        ior,
        source: JENSEN,
    });
    let narasimhan = NARASIMHAN_TABLE.iter().map(|&(name, sigma_s, sigma_a, g)| Preset {
        name,
        sigma_s_prime: DVec3::from_array(sigma_s) * (1.0 - DVec3::from_array(g)),
        sigma_a: DVec3::from_array(sigma_a),
        g: DVec3::from_array(g),
        ior: NARASIMHAN_IOR,
        source: NARASIMHAN,
    });
    jensen.chain(narasimhan).collect()
}

/// The material of that name, or a sentence that says which names are close.
pub fn preset(name: &str) -> Result<Preset, String> {
    let all = presets();
    if let Some(found) = all.iter().find(|preset| preset.name == name) {
        return Ok(*found);
    }
    let wanted = name.to_lowercase();
    let mut close: Vec<(usize, &str)> = all
        .iter()
        .map(|preset| (if preset.name.contains(&wanted) { 0 } else { distance(preset.name, &wanted) }, preset.name))
        .collect();
    close.sort();
    let names: Vec<&str> = close.iter().take(4).map(|(_, name)| *name).collect();
    Err(format!("unknown preset \"{}\"; close names: {}", super::json::shorten(name), names.join(", ")))
}

/// Least number of characters to insert, delete or replace that turns `a` into `b` (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    // A name longer than any of ours is as far from each as it is long, near enough.
    let b: Vec<char> = b.chars().take(64).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

/// Name, REDUCED scattering, absorption [1/mm], index of refraction.
#[rustfmt::skip]
const JENSEN_TABLE: &[(&str, [f64; 3], [f64; 3], f64)] = &[
    ("apple", [2.29, 2.39, 1.97], [0.0030, 0.0034, 0.046], 1.3),
    ("chicken1", [0.15, 0.21, 0.38], [0.015, 0.077, 0.19], 1.3),
    ("chicken2", [0.19, 0.25, 0.32], [0.018, 0.088, 0.20], 1.3),
    ("cream", [7.38, 5.47, 3.15], [0.0002, 0.0028, 0.0163], 1.3),
    ("ketchup", [0.18, 0.07, 0.03], [0.061, 0.97, 1.45], 1.3),
    ("marble", [2.19, 2.62, 3.00], [0.0021, 0.0041, 0.0071], 1.5),
    ("potato", [0.68, 0.70, 0.55], [0.0024, 0.0090, 0.12], 1.3),
    ("skimmilk", [0.70, 1.22, 1.90], [0.0014, 0.0025, 0.0142], 1.3),
    ("skin1", [0.74, 0.88, 1.01], [0.032, 0.17, 0.48], 1.3),
    ("skin2", [1.09, 1.59, 1.79], [0.013, 0.070, 0.145], 1.3),
    ("spectralon", [11.6, 20.4, 14.9], [0.00, 0.00, 0.00], 1.3),
    ("wholemilk", [2.55, 3.21, 3.77], [0.0011, 0.0024, 0.014], 1.3),
];

/// Name, scattering (not reduced), absorption [1/mm], mean cosine.
#[rustfmt::skip]
#[allow(clippy::type_complexity)]
const NARASIMHAN_TABLE: &[(&str, [f64; 3], [f64; 3], [f64; 3])] = &[
    ("lowfat_milk", [13.1157, 15.4445, 17.9572], [0.00287, 0.00575, 0.01150], [0.932, 0.902, 0.859]),
    ("reduced_milk", [13.7335, 15.6003, 17.8007], [0.00256, 0.00511, 0.01278], [0.819, 0.797, 0.746]),
    ("regular_milk", [18.2052, 20.3826, 22.3698], [0.00153, 0.00460, 0.01993], [0.750, 0.714, 0.681]),
    ("espresso", [7.78262, 8.13050, 8.53875], [4.79838, 6.57512, 8.84925], [0.907, 0.896, 0.880]),
    ("mint_mocha_coffee", [3.51133, 4.14383, 5.59667], [3.77200, 5.82283, 7.82000], [0.910, 0.907, 0.914]),
    ("lowfat_soy_milk", [2.03838, 2.32875, 3.90281], [0.00144, 0.00719, 0.03594], [0.850, 0.853, 0.842]),
    ("regular_soy_milk", [4.66325, 5.20183, 8.74575], [0.00192, 0.00958, 0.06517], [0.873, 0.858, 0.832]),
    ("lowfat_chocolate_milk", [9.83710, 11.4954, 13.1629], [0.01150, 0.03680, 0.15640], [0.934, 0.927, 0.916]),
    ("regular_chocolate_milk", [10.5685, 13.1416, 15.2202], [0.01006, 0.04313, 0.14375], [0.862, 0.838, 0.806]),
    ("coke", [0.00254, 0.00299, 0.0], [0.10014, 0.16503, 0.24680], [0.965, 0.972, 0.0]),
    ("pepsi", [0.00083, 0.00203, 0.0], [0.09164, 0.14158, 0.20729], [0.926, 0.979, 0.0]),
    ("sprite", [0.00011, 0.00014, 0.00014], [0.00189, 0.00183, 0.00200], [0.943, 0.953, 0.952]),
    ("gatorade", [0.03668, 0.04488, 0.05742], [0.02479, 0.01929, 0.00888], [0.933, 0.933, 0.935]),
    ("chardonnay", [0.00021, 0.00033, 0.00048], [0.01078, 0.01186, 0.02400], [0.914, 0.958, 0.975]),
    ("white_zinfandel", [0.00022, 0.00033, 0.00046], [0.01207, 0.01618, 0.01984], [0.919, 0.943, 0.972]),
    ("merlot", [0.00081, 0.0, 0.0], [0.11632, 0.25191, 0.29434], [0.974, 0.0, 0.0]),
    ("budweiser_beer", [0.00029, 0.00055, 0.00059], [0.01149, 0.02491, 0.05779], [0.917, 0.956, 0.982]),
    ("coors_light_beer", [0.00062, 0.00127, 0.0], [0.00616, 0.01398, 0.03498], [0.918, 0.966, 0.0]),
    ("clorox", [0.02731, 0.03302, 0.03695], [0.00335, 0.01489, 0.02630], [0.912, 0.905, 0.892]),
    ("apple_juice", [0.00257, 0.00311, 0.00413], [0.01296, 0.02374, 0.05218], [0.947, 0.949, 0.945]),
    ("cranberry_juice", [0.00196, 0.00238, 0.00301], [0.03944, 0.09422, 0.12426], [0.947, 0.951, 0.974]),
    ("grape_juice", [0.00138, 0.0, 0.0], [0.10404, 0.23958, 0.29325], [0.961, 0.0, 0.0]),
    ("ruby_grapefruit_juice", [0.15496, 0.15391, 0.15995], [0.08587, 0.18314, 0.25262], [0.929, 0.929, 0.931]),
    ("white_grapefruit_juice", [0.50499, 0.52742, 0.75282], [0.01380, 0.01883, 0.05678], [0.548, 0.545, 0.565]),
    ("shampoo", [0.00797, 0.00874, 0.01127], [0.01411, 0.04569, 0.06172], [0.910, 0.905, 0.920]),
    ("strawberry_shampoo", [0.00215, 0.00245, 0.00253], [0.01449, 0.05796, 0.07582], [0.927, 0.935, 0.994]),
    ("head_shoulders_shampoo", [0.26747, 0.27696, 0.29574], [0.08462, 0.15688, 0.20365], [0.911, 0.896, 0.884]),
    ("lemon_tea_powder", [0.74489, 0.83823, 1.00158], [2.42881, 4.57573, 7.21270], [0.946, 0.946, 0.949]),
    ("orange_juice_powder", [0.00193, 0.00213, 0.00226], [0.00145, 0.00344, 0.00786], [0.919, 0.918, 0.922]),
    ("pink_lemonade_powder", [0.00123, 0.00133, 0.00131], [0.00116, 0.00237, 0.00320], [0.902, 0.902, 0.904]),
    ("cappuccino_powder", [12.2094, 16.4659, 29.2727], [35.8441, 49.5470, 61.0844], [0.849, 0.843, 0.926]),
    ("salt_powder", [0.13805, 0.15677, 0.17865], [0.28415, 0.32570, 0.34148], [0.802, 0.793, 0.821]),
    ("sugar_powder", [0.00282, 0.00315, 0.00393], [0.01264, 0.03105, 0.05012], [0.921, 0.919, 0.931]),
    ("suisse_mocha_powder", [30.0848, 33.4452, 38.7191], [17.5020, 27.0044, 35.4334], [0.907, 0.894, 0.888]),
    ("pacific_ocean_surface_water", [0.00180, 0.00183, 0.00228], [0.03184, 0.03132, 0.03015], [0.902, 0.825, 0.914]),
];
