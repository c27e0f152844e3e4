//! THE definition of all that Rust and GLSL share: structs, buffer slots, scene features, constants.
//!
//! `build.rs` includes this module and writes `glsl/shared.glsl` from it ([`glsl`]). The structs are
//! `repr(C)` and `Pod` here and `scalar` there; neither layout can hold hidden padding, so equal text
//! means equal bytes, and a test reads the offsets back out of the SPIR-V.
//!
//! Lengths are in *internal units* unless a field says otherwise: the scene is moved to its centre and
//! scaled so that its translucent part has about radius 1 (see `scene::Frame`). Colours are linear
//! Rec.709.

#[macro_use]
mod macros;

pub use macros::{Glsl, NamedFeature, StructLayout};

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, UVec4, Vec2, Vec3, Vec4};

constants! {
    /// Invocations of a workgroup unless a caller chooses otherwise (local_size_x_id = 0).
    WORKGROUP: u32 = 64;
    /// Independently scrambled batches of the low-discrepancy points; sample s belongs to batch s % BATCHES.
    BATCHES: u32 = 8;
    /// Consecutive samples of one batch that share a sub-pixel stratum, and so a G-buffer.
    STRATUM: u32 = 4;
    /// Most samples of one recording into a caller's command buffer.
    MAX_RECORDED: u32 = 4096;
    /// Value of `Progress::end` where the sums are to be forgotten.
    NO_SAMPLES: u32 = 0xffffffffu32;
    /// Most hits that a probe keeps; of more, this many are kept uniformly at random and reweighted.
    MAX_HITS: u32 = 8;
    /// Most lights of one dispatch of `single`, which takes two rays to each and one more.
    MAX_SINGLE: u32 = 2;
    /// Most shadow rays of one dispatch of `accumulate` or `reflect`, far below Mesa 22's cap of 65,535 loop trips.
    MAX_RAYS: u32 = 4;
    /// Distance along the geometric normal from a surface to the origin of its shadow rays [internal units]: some 30
    /// roundings of a position. Creases narrower than this are lit as if
    /// open. `reflect`, which also sees what lies far outside the unit ball, scales it with the triangle's extent there.
    SHADOW_OFFSET: f32 = 3.814_697_3e-6;
    /// Part of the way to a point of an emitter that must be free: what stands between the rest, 4e-6 of the distance, and
    /// another triangle of the emitter that rounding puts there, casts no shadow.
    EMITTER_REACH: f32 = 0.999_996_2;
    /// Values of a rough boundary's transmittance, at cosines (i / (BOUNDARY_NODES - 1))^2.
    BOUNDARY_NODES: u32 = 128;
    /// Numbers in a row of a rough boundary's table: the transmittance at the nodes, then what radiance that leaves is
    /// divided by, 1 - rho_e or 1.
    BOUNDARY_ROW: u32 = 129;
    /// Rows of a boundary whose roughness a texture changes, at the shares (i / (ROUGHNESS_ROWS - 1))^2 of the factor.
    ROUGHNESS_ROWS: u32 = 33;
    /// Least GGX width of an opaque material, which has no mirror.
    OPAQUE_ALPHA_MIN: f32 = 1e-3;
    /// Most media of one set of surfaces that exchange light.
    MAX_MEMBERS: u32 = 8;
    /// Points below one node of the cloud that `gather` starts from at most, so that it stays below Mesa 22's cap of 65,535
    /// loop trips whatever it opens.
    GATHER_POINTS: u32 = 4096;
    /// Row that stands for the points of the cloud in the keys of random numbers, in which pixels have their own.
    POINTS_ROW: u32 = 0xffffffffu32;
    /// Value of `Cluster::set` where points of several sets lie below it.
    SEVERAL: u32 = 0xffffffffu32;
    /// Most levels of the BVH, and so entries of a traversal's stack; the host refuses deeper trees.
    BVH_DEPTH: u32 = 24;
    /// Words before the lists of Actives: four for each batch.
    ACTIVE_HEADER: u32 = 32;
    /// Value of `Surface::triangle` for a ray that hits nothing.
    MISS: u32 = 0xffffffffu32;

    /// Integrator: probes, whose hits are lit.
    INTEGRATOR_SAMPLE: u32 = 0;
    /// Integrator: points on the surface are lit once, and each pixel gathers from them.
    INTEGRATOR_CLOUD: u32 = 1;
    /// Integrator: points uniform over the area of the surface, on the host.
    INTEGRATOR_AREA: u32 = 2;
    /// Integrator: random walks through the matter, on the host.
    INTEGRATOR_WALK: u32 = 3;

    /// Projection: all techniques combined by the balance heuristic.
    PROJECTION_MIS: u32 = 0;
    /// Projection: the camera ray alone, first hit, as the method was given.
    PROJECTION_CAMERA: u32 = 1;
    /// Projection: the normal axis alone, all hits.
    PROJECTION_NORMAL: u32 = 2;

    /// Reproject: rays are traced through the scene.
    REPROJECT_TRACE: u32 = 0;
    /// Reproject: points are looked up in the G-buffer.
    REPROJECT_SCREEN: u32 = 1;
    /// Irradiance: shadow rays from each hit.
    IRRADIANCE_DIRECT: u32 = 0;
    /// Irradiance: interpolated between points of the surface, which are lit once.
    IRRADIANCE_CACHED: u32 = 1;
    /// Looking up: pixels' widths between a hit in the plane of the triangle that a pixel sees and the point of it that the
    /// pixel sees, at most.
    SCREEN_REACH: f32 = 4.0;

    /// Model: the standard dipole of Jensen et al. 2001.
    MODEL_STANDARD: u32 = 0;
    /// Model: the better dipole of d'Eon 2012.
    MODEL_BETTER: u32 = 1;
    /// Model: the directional dipole of Frisvad et al. 2014, which also depends on where light comes from.
    MODEL_DIRECTIONAL: u32 = 2;
    /// Model: normalised diffusion of Christensen and Burley 2015.
    MODEL_BURLEY: u32 = 3;
    /// Model: profiles tabulated by simulation.
    MODEL_TABLE: u32 = 4;
    /// Model: the opaque limit, where light leaves where it entered.
    MODEL_LAMBERT: u32 = 5;
    /// Bits of an f32 below those that number a cell of a tabulated profile.
    TABLE_SHIFT: u32 = 21;
    /// Vectors before a table's cells at each curvature.
    TABLE_HEADER: u32 = 3;
    /// Bits of each of the two values of a table's packed cell.
    TABLE_BITS: u32 = 12;
    /// Most halvings in the search of a distribution function, for at most 500 cells.
    TABLE_HALVINGS: u32 = 9;
    /// Most curvatures of a table.
    TABLE_NODES: u32 = 40;

    /// Radius below which normalised diffusion, which is infinite at 0, counts as there [internal units].
    BURLEY_RADIUS_MIN: f32 = 1e-15;

    /// No environment.
    ENVIRONMENT_NONE: u32 = 0;
    /// The same radiance from everywhere.
    ENVIRONMENT_CONSTANT: u32 = 1;
    /// A latitude-longitude image.
    ENVIRONMENT_IMAGE: u32 = 2;

    /// Material flag: light enters and leaves through this surface (a BSSRDF).
    TRANSLUCENT: u32 = 1;
    /// Material flag: the directional dipole is averaged with itself, light and eye exchanged.
    RECIPROCAL: u32 = 256;
    /// Material flag: the surface's emission lights both sides, not only the one from which its vertices run
    /// counter-clockwise.
    TWO_SIDED: u32 = 2;

    /// Light kind: position and intensity [W/sr].
    LIGHT_POINT: u32 = 0;
    /// Light kind: a point light with a cone.
    LIGHT_SPOT: u32 = 1;
    /// Light kind: direction and perpendicular irradiance [W/m^2].
    LIGHT_DIRECTIONAL: u32 = 2;

    /// Kind of texture: base colour (sRGB).
    TEXTURE_BASE_COLOR: u32 = 0;
    /// Kind of texture: metallic in blue, roughness in green.
    TEXTURE_METALLIC_ROUGHNESS: u32 = 1;
    /// Kind of texture: normals in the tangent frame; `Texture::scale` multiplies x and y.
    TEXTURE_NORMAL: u32 = 2;
    /// Kind of texture: emitted light (sRGB).
    TEXTURE_EMISSION: u32 = 3;
    /// Kind of texture: multi-scatter colour (sRGB).
    TEXTURE_SCATTER_COLOR: u32 = 4;
    /// Kind of texture: scatter strength in alpha.
    TEXTURE_SCATTER_STRENGTH: u32 = 5;
    /// Kind of texture: a surface is where alpha times `Texture::scale` is at least 1.
    TEXTURE_ALPHA: u32 = 6;
    /// Kinds of texture, each an entry of every material.
    TEXTURE_KINDS: u32 = 7;
    /// Beyond the edge a texture repeats.
    WRAP_REPEAT: u32 = 0;
    /// Beyond the edge a texture goes on with its last texel.
    WRAP_CLAMP: u32 = 1;
    /// Beyond the edge a texture repeats in mirror images.
    WRAP_MIRROR: u32 = 2;
    /// Steps of a material's ramp, along which textures move its medium.
    RAMP: u32 = 512;
    /// Share of camera rays among the probes of all techniques combined, where the camera looks onto the surface. This and
    /// the next by measured squared errors of six scenes (a slab, balls, Spot; 8 samples, tiles): .25 and .25 have 0 to 11 %
    /// less, but on a flat place under tiles 40 % more; .15 and .25, .1 and .33 or .4 and .15 more on some and less on
    /// others; .55 and .15 a quarter more.
    CAMERA_FRACTION: f32 = 0.4;
    /// Share of the two tangents among the rest.
    TANGENT_FRACTION: f32 = 1.0 / 3.0;
    /// Cosine of view below which the share of camera rays falls.
    CAMERA_FADE: f32 = 0.3;
    /// GGX width below which a surface is a mirror: D, of the order 1 / alpha^2, would leave f32.
    MIRROR_ALPHA: f32 = 1e-6;

    /// Dimension: radius.
    DIM_RADIUS: u32 = 0;
    /// Dimension: angle in the tangent plane.
    DIM_ANGLE: u32 = 1;
    /// Dimension: technique (axis).
    DIM_TECHNIQUE: u32 = 2;
    /// Dimension: component of the radial density (channel and source).
    DIM_COMPONENT: u32 = 3;
    /// Dimension: which hit of the probe is lit.
    DIM_HIT: u32 = 4;
    /// Coordinates of the point that the host computes for each sample: the dimensions above.
    DIMENSIONS: u32 = 5;
    /// Dimensions 5 and 6: position within the pixel (a point per stratum, not per sample).
    DIM_PIXEL: u32 = 5;
    /// Dimensions 7 and 8: environment direction at the exit (a point per direction).
    DIM_LIGHT: u32 = 7;
    /// Dimensions 9 and 10: environment direction at the first surface (a point per direction).
    DIM_REFLECT: u32 = 9;
    /// Dimension of the hash that keeps hits beyond MAX_HITS.
    DIM_OVERFLOW: u32 = 11;
    /// Dimensions 12 and 13: point of an emitter for the exit (a point per direction).
    DIM_EMITTER: u32 = 12;
    /// Dimensions 14 and 15: point of an emitter for the first surface (a point per direction).
    DIM_EMITTER_REFLECT: u32 = 14;
    /// Dimensions 16 and 17: channel and depth of single scattering (`point` 0 and 1, scrambled otherwise).
    DIM_SINGLE: u32 = 16;
    /// Dimensions 18 and 19: environment direction at that point (a point per direction).
    DIM_SINGLE_LIGHT: u32 = 18;
    /// Dimensions 20 and 21: point of an emitter for that point (a point per direction).
    DIM_SINGLE_EMITTER: u32 = 20;
    /// Dimension of the hash that draws where tabulated profiles of a tile's hits are read.
    DIM_REUSE: u32 = 22;
    /// Dimension: whether a ray goes to a point of an emitter, for the exit (a number per direction).
    DIM_SOURCE: u32 = 23;
    /// Dimension: the same, for single scattering.
    DIM_SINGLE_SOURCE: u32 = 24;
    /// 2^32 over the golden ratio: the step of numbers that cover [0, 1) evenly.
    GOLDEN: u32 = 0x9e37_79b9;
    /// Added to a dimension for what the place in a tile brings to it.
    DIM_PLACE: u32 = 32;

    /// Of `functions`: x y + z, x / y and sqrt |x|, for what the device's arithmetic is.
    FUNCTION_ARITHMETIC: u32 = 0;
    /// Of `functions`: dot, length and cross product.
    FUNCTION_DOT: u32 = 1;
    /// Of `functions`: `hash`.
    FUNCTION_HASH: u32 = 2;
    /// Of `functions`: `scramble`.
    FUNCTION_SCRAMBLE: u32 = 3;
    /// Of `functions`: `sobol1`.
    FUNCTION_SOBOL: u32 = 4;
    /// Of `functions`: `dimension_key` of `pixel_key`.
    FUNCTION_KEY: u32 = 5;
    /// Of `functions`: `random_point`.
    FUNCTION_POINT: u32 = 6;
    /// Of `functions`: `exp_`.
    FUNCTION_EXP: u32 = 7;
    /// Of `functions`: `log_`.
    FUNCTION_LOG: u32 = 8;
    /// Of `functions`: `log1p_`.
    FUNCTION_LOG1P: u32 = 9;
    /// Of `functions`: `one_minus_exp_over`.
    FUNCTION_ONE_MINUS_EXP_OVER: u32 = 10;
    /// Of `functions`: `cos_sin_2pi`.
    FUNCTION_COS_SIN: u32 = 11;
    /// Of `functions`: `atan2_`.
    FUNCTION_ATAN2: u32 = 12;
    /// Of `functions`: `orthonormal_basis`.
    FUNCTION_BASIS: u32 = 13;
    /// Of `functions`: `fresnel`.
    FUNCTION_FRESNEL: u32 = 14;
    /// Of `functions`: `crossing` and `leaving_share`.
    FUNCTION_CROSSING: u32 = 15;
    /// Of `functions`: `ggx_distribution` and `ggx_lambda`.
    FUNCTION_GGX: u32 = 16;
    /// Of `functions`: `draw_half_vector`.
    FUNCTION_HALF_VECTOR: u32 = 17;
    /// Of `functions`: `refracted`.
    FUNCTION_REFRACTED: u32 = 18;
    /// Of `functions`: `phase`.
    FUNCTION_PHASE: u32 = 19;
    /// Of `functions`: `draw_phase`.
    FUNCTION_DRAW_PHASE: u32 = 20;
    /// Of `functions`: `texture_at`, colour.
    FUNCTION_TEXTURE: u32 = 21;
    /// Of `functions`: `texture_at`, alpha.
    FUNCTION_TEXTURE_ALPHA: u32 = 22;
    /// Of `functions`: `delta_light`, irradiance.
    FUNCTION_DELTA_LIGHT: u32 = 23;
    /// Of `functions`: `delta_light`, direction.
    FUNCTION_LIGHT_DIRECTION: u32 = 24;
    /// Of `functions`: `environment_radiance`.
    FUNCTION_ENVIRONMENT: u32 = 25;
    /// Of `functions`: `environment_density`.
    FUNCTION_ENVIRONMENT_DENSITY: u32 = 26;
    /// Of `functions`: `draw_environment`.
    FUNCTION_DRAW_ENVIRONMENT: u32 = 27;
    /// Of `functions`: `draw_cosine`.
    FUNCTION_DRAW_COSINE: u32 = 28;
    /// Of `functions`: `draw_emitter`.
    FUNCTION_DRAW_EMITTER: u32 = 29;
    /// Of `functions`: `emitter_density` in `combined`.
    FUNCTION_EMITTER_DENSITY: u32 = 30;
    /// Of `functions`: `shape_shifted`.
    FUNCTION_SHAPE: u32 = 31;
    /// Of `functions`: `draw_radius` and `radial_density`.
    FUNCTION_RADIUS: u32 = 32;
    /// Of `functions`: `directional_value`.
    FUNCTION_DIRECTIONAL: u32 = 33;
    /// Of `functions`: `obliqueness`.
    FUNCTION_OBLIQUENESS: u32 = 34;
    /// Of `functions`: `pick_member`.
    FUNCTION_PICK: u32 = 35;
    /// Of `functions`: `technique_fractions`.
    FUNCTION_FRACTIONS: u32 = 36;
    /// Of `functions`: `seen`.
    FUNCTION_SEEN: u32 = 37;
    /// Of `functions`: `mixture_density` and `camera_ratio`.
    FUNCTION_DENSITY: u32 = 38;
    /// Of `functions`: `traverse` for the nearest hit.
    FUNCTION_CLOSEST: u32 = 39;
    /// Of `functions`: `traverse` for any hit.
    FUNCTION_ANY: u32 = 40;
    /// Of `functions`: `traverse` for all hits.
    FUNCTION_ALL: u32 = 41;
    /// Of `functions`: `compensated_add`.
    FUNCTION_ADD: u32 = 42;
}

structs! {
    /// What is constant over a render: camera, pixels, environment, counts.
    struct View {
        /// A point on the camera's axis near the scene's centre; rays pass through the plane there.
        pivot: Vec3,
        /// From the pivot to the right edge of the full image, in that plane.
        right: Vec3,
        /// From the pivot to the upper edge of the full image.
        up: Vec3,
        /// From the eye to the pivot (perspective); a unit vector (orthographic).
        forward: Vec3,
        /// 1 for a perspective camera, 0 for an orthographic one.
        perspective: f32,
        /// Orthographic only: distance from the camera's plane to the pivot's.
        reach: f32,
        /// Width of the full image (pixels).
        width: u32,
        /// Height of the full image (pixels).
        height: u32,
        /// First column that is rendered.
        crop_x: u32,
        /// Columns that are rendered.
        crop_width: u32,
        /// Key of all random numbers.
        seed: u32,
        /// Incoming directions at each position, N, of the environment and of emitters.
        directions: u32,
        /// Delta lights in the scene.
        light_count: u32,
        /// Triangles that emit light.
        emitter_count: u32,
        /// Centre of a ball around them.
        emitters_centre: Vec3,
        /// Square of its radius.
        emitters_radius2: f32,
        /// 1 to add the environment where a camera ray hits nothing.
        show_environment: u32,
        /// Tiles: twice the number of sets.
        groups: u32,
        /// Leaves of the cloud's tree, a power of two.
        leaves: u32,
        /// Radius over distance below which a cluster's centre stands for its points.
        opening: f32,
        /// Constant radiance, or the factor on the image's.
        environment_scale: Vec3,
        /// World direction to image direction: rows of a rotation.
        environment_row0: Vec3,
        environment_row1: Vec3,
        environment_row2: Vec3,
        /// Texels of the environment image.
        environment_width: u32,
        environment_height: u32,
        /// Cells of the environment's sampling density.
        density_width: u32,
        density_height: u32,
    }

    /// What changes from dispatch to dispatch (push constants, at most 128 bytes).
    struct Step {
        /// First pixel row of the band, in the full image.
        first_row: u32,
        /// Pixels in the band.
        pixel_count: u32,
        /// Index of the sample: number sample_index / BATCHES of batch sample_index % BATCHES. In a recording, the sample's
        /// position in it; for `begin`, the start of the recording's range.
        sample_index: u32,
        /// 1 to trace `primary` through the pixel's centre, for the AOVs.
        pixel_centre: u32,
        /// First shadow ray of this dispatch: delta lights first, then directions.
        ray_begin: u32,
        /// Shadow rays of this dispatch; 0 where the scene has no light.
        ray_count: u32,
        /// 1 in the sample's first dispatch of `reflect`, which also adds what does not depend on shadow rays, and of
        /// `gather`, which begins its sums.
        first: u32,
        /// 1 in the sample's last dispatch of `gather`.
        last: u32,
        /// 1 in the sample's first dispatch of all that add to the sums: it counts whether the pixel is covered. Of `count`,
        /// the samples that it adds.
        count: u32,
        /// Pixels that `primary` and `count` take from the list of those to trace; 0 for all of the band.
        traced: u32,
        /// First sample in the sums, for `resolve`; of those that light the cloud.
        range_begin: u32,
        /// End of those that light the cloud.
        range_end: u32,
        /// Node of the cloud's tree: the first one of `cluster`'s level, the one that `gather` starts from. The first of the
        /// points that `irradiance` lights.
        node: u32,
        /// The unscrambled point number sample_index / BATCHES of the sequence, dimensions 0 to DIMENSIONS - 1.
        point: [u32; 5],
    }

    /// Which samples the sums hold, where recordings keep count of them (`RECORDED`).
    struct Progress {
        /// Added to the range of every recording.
        first: u32,
        /// First sample of the sums.
        begin: u32,
        /// End of the samples of the sums; NO_SAMPLES where they are to be forgotten.
        end: u32,
        /// 1 where the recording that runs started new sums.
        restart: u32,
    }

    /// A sample of the recording that runs, written by `begin`.
    struct Sample {
        /// As `Step::sample_index` without recordings.
        index: u32,
        /// As `Step::point` without recordings.
        point: [u32; 5],
    }

    /// A triangle in the order of the BVH's leaves, for traversal.
    struct Triangle {
        /// Counter-clockwise as seen from outside the matter; triangles that share a vertex have its very bits.
        vertices: [Vec3; 3],
        /// The set of surfaces that exchange light, to which it belongs.
        set: u32,
    }

    /// What shading needs of a triangle, in the same order.
    struct Shading {
        /// Interpolated (unit, outward) normals at the three vertices.
        normal0: Vec3,
        normal1: Vec3,
        normal2: Vec3,
        /// Index of the material.
        material: u32,
    }

    /// A material as kernels read it. A model's profile is strength x shape(r); its file in `reference::profile` says
    /// which of the numbers it uses. Directional dipole: shape and strength of the standard dipole choose hits and radii.
    struct Material {
        /// Rate of each channel's exponential [1/length]: sigma_tr of the dipoles, 1/d of normalised diffusion.
        sigma_tr: Vec3,
        /// Dipoles: depth of the real source z_r of each channel.
        z_real: Vec3,
        /// Dipoles: height of the virtual source z_v of each channel (positive).
        z_virtual: Vec3,
        /// Better dipole: the fluence's part over the flux's, C_phi / (C_E D) [1/length].
        fluence: Vec3,
        /// Directional dipole: 2 A d_e, the height of the virtual source over the modified tangent plane.
        height: Vec3,
        /// Directional dipole: 1 / (3 sigma_t), with sigma_t not reduced.
        free_path: Vec3,
        /// Directional dipole: kappa / (3 sigma_t), the least that keeps its real source from the exit.
        floor: Vec3,
        /// Directional dipole: what stands before its maximum, with the renormalisation.
        beam: Vec3,
        /// Directional dipole: C_phi.
        c_phi: f32,
        /// Directional dipole: C_E.
        c_e: f32,
        /// Radiance per unit shape(r) and unit flux that entered: for dipoles alpha'/2 / (pi (1 - rho_e)); /pi alone for
        /// jensen2001; without either where sets hold several materials.
        strength: Vec3,
        /// Channel probability over the shape's integral, b_c / mass_c: the density of r is dot(density, shape(r)).
        density: Vec3,
        /// Cumulative probability of the sampler's nine components, three of each channel; see `reference::profile`. All 0
        /// where no radius is drawn.
        component_cdf: [f32; 9],
        /// One of MODEL_*.
        model: u32,
        /// Radius of the ball in which probes look for surfaces.
        radius_max: f32,
        /// Rate of the camera projection's exponential: the smallest at which a channel's profile falls [1/length].
        camera_rate: f32,
        /// Index of refraction, inside over outside.
        ior: f32,
        /// Extinction sigma_t, not reduced, for single scattering [1/length].
        extinction: Vec3,
        /// Scattering sigma_s, not reduced [1/length]; 0 where single scattering is not added.
        scattering: Vec3,
        /// Mean cosine of the phase function.
        g: Vec3,
        /// GGX width alpha = roughness^2; 0 is a smooth mirror.
        alpha: f32,
        /// Linear base colour of an opaque material.
        base_color: Vec3,
        metallic: f32,
        /// Emitted radiance.
        emission: Vec3,
        /// Table: its first number, first cell of the squared distance, cells and curvatures.
        table: u32,
        table_first: u32,
        table_cells: u32,
        table_nodes: u32,
        /// Table, and its opaque limit: mean of 1 - cosine of refraction over diffuse light that enters.
        obliqueness: f32,
        /// Opaque limit of a table: slope of the total in 1 - cosine of refraction.
        slope: Vec3,
        /// Table: the number of triangle 0 in Balances, for this material's profile.
        balance: u32,
        /// Of TRANSLUCENT, TWO_SIDED and RECIPROCAL.
        flags: u32,
        /// First of RAMP + 1 materials whose medium goes from black to this one's; 0 where no texture changes it.
        ramp: u32,
        /// 1 + the number of its table in Boundaries; 0 for a smooth boundary.
        boundary: u32,
        /// Cloud: radius within which light is interpolated between points.
        reach: f32,
        /// Where sets hold several materials: what strength and beam leave out and the exit's material brings, its tint over
        /// pi (1 - rho_e).
        exit: Vec3,
    }

    /// What a material's tabulated profile needs of a triangle, at the three vertices.
    struct Balance {
        /// Factors with which the profile gives back what its sphere does.
        at: [Vec3; 3],
        /// 1 over the radius of the sphere that the body resembles there.
        curvature: Vec3,
    }

    /// A point whose light is kept, as of the cloud (a leaf), or what the points below a node of its tree have in common.
    struct Cluster {
        /// Of several points, the mean by flux.
        position: Vec3,
        /// Geometric normal, of several points the mean by flux; 0 where they have none.
        normal: Vec3,
        /// Distance within which all of its points are.
        radius: f32,
        /// Mean squared distance of its points from that, by flux.
        spread: f32,
        /// Flux that enters: of table models, at slope 0.
        flux: Vec3,
        /// Flux times 1 - cosine of refraction, which the slope of table models multiplies.
        oblique: Vec3,
        /// Area that its points stand for; 0 for a leaf without a point.
        area: f32,
        /// Near mass times area.
        mass: Vec3,
        /// The set that they belong to, or SEVERAL.
        set: u32,
        /// Of a leaf: its triangle, and the weights of the second and third vertex.
        triangle: u32,
        barycentric: Vec2,
    }

    /// Points of a triangle, or of one of the patches that it is cut into, whose light is kept: b1 = i / cells,
    /// b2 = j / cells with whole numbers i + j <= cells.
    struct Lattice {
        /// Patches along each edge; 1 for a triangle that is not cut. Patches by rising j, then i, the lower one before
        /// the upper one: they follow in Lattices from `first` on, and there is nothing else here.
        patches: u32,
        /// Cells along each edge; 0 for a triangle that lets no light in, or is in the opaque limit.
        cells: u32,
        /// The points at its three vertices, which triangles around a vertex share. Of an upper patch the first is the one
        /// with the largest b1 and b2, then follows that with the largest b2.
        corners: [u32; 3],
        /// The first of its other points: by rising j, then i.
        first: u32,
    }

    /// What a pixel has gathered so far.
    struct Gather {
        /// From afar.
        far: Vec3,
        /// Weighted light and weights of the points that are near.
        near: Vec3,
        weight: Vec3,
        /// Weighted near masses.
        mass: Vec3,
    }

    /// The media of a set of several materials.
    struct Mixture {
        /// A material of each medium that scatters; radii are drawn from each with the same probability.
        members: [u32; 8],
        count: u32,
        /// Largest radius_max of the members.
        radius_max: f32,
        /// Smallest camera_rate of the members.
        camera_rate: f32,
    }

    /// One texture of a material. Texel (0, 0) is the upper left one, at the coordinates (0, 0).
    struct Texture {
        /// Texels in a row; 0 where the material has no texture of the kind.
        width: u32,
        height: u32,
        /// Its first word in Texels.
        offset: u32,
        /// 1 where red, green and blue are sRGB-encoded.
        srgb: u32,
        /// WRAP_* across and down.
        wrap_u: u32,
        wrap_v: u32,
        /// 1 to interpolate between texels, 0 to take the nearest.
        linear: u32,
        /// Which of a triangle's two coordinates it uses.
        set: u32,
        /// The rows of the affine map from the triangle's coordinates to the texture's.
        row_u: Vec3,
        row_v: Vec3,
        /// What its kind says.
        scale: f32,
    }

    /// What textures need to know of a triangle.
    struct Coordinates {
        /// Texture coordinates of the three vertices: set 0, then set 1.
        uv: [Vec2; 6],
        /// Direction of growing u at the vertices; 0 where there is none.
        tangent: [Vec3; 3],
        /// 1 or -1: the bitangent is this times normal x tangent.
        handedness: f32,
        /// Index of the material.
        material: u32,
    }

    /// A delta light.
    struct Light {
        position: Vec3,
        /// Unit vector in which the light shines (spot, directional).
        direction: Vec3,
        /// Point and spot: intensity x (internal units per metre)^2. Directional: perpendicular irradiance.
        intensity: Vec3,
        /// LIGHT_POINT, LIGHT_SPOT or LIGHT_DIRECTIONAL.
        kind: u32,
        /// Spot: the angular factor is saturate(cosine * scale + offset)^2.
        spot_scale: f32,
        spot_offset: f32,
        /// KHR_lights_punctual range: factor max(1 - (d * inverse_range)^4, 0); 0 is infinite range.
        inverse_range: f32,
    }

    /// A triangle that emits light.
    struct Emitter {
        triangle: u32,
        /// Probability that a point is drawn on it, over its area.
        density: f32,
        /// Probability of those before it, and with its own; multiples of 2^-24.
        cumulative: [f32; 2],
    }

    /// The surface a camera ray meets first (the G-buffer), written by `primary`.
    struct Surface {
        position: Vec3,
        /// Triangle, or MISS.
        triangle: u32,
        /// Weights of the second and third vertex.
        barycentric: Vec2,
    }

    /// A probe ray, written by `sample`: all points `xo + offset + t * direction` with t in [t_min, t_max].
    struct Probe {
        /// From xo to the ray's origin.
        offset: Vec3,
        /// Unit vector.
        direction: Vec3,
        t_min: f32,
        /// Below t_min for a pixel without a probe.
        t_max: f32,
        /// Camera projection only: radius in the tangent plane.
        radius: f32,
        /// Tiles only. Bits of xo, and of the squared distance beyond which the pixel's profile, or the ball of its probes,
        /// ends.
        seat: UVec4,
        /// Tabulated profile at the surface that is seen: the first of two curvatures, its weight, how distances bend for
        /// both, and 1/4a^2.
        table_node: u32,
        table_weight: f32,
        table_bend: Vec2,
        table_scale: f32,
        /// Written by `accumulate`: the hit that is lit, and its squared distance from xo.
        hit: Vec3,
        hit_r2: f32,
        /// Tiles only. Bits of the hit's light over the tile's weights, which `accumulate` writes; and (1 + sample) x
        /// View::groups + 2 x the set, and 1 more where its inner side is seen: pixels that have the same share hits, also
        /// without a probe; 0 for none.
        lit: UVec4,
    }

    /// Where a probe meets surfaces of its set, written by `reproject`.
    struct Hits {
        /// Hits found; the first min(count, MAX_HITS) entries are set.
        count: u32,
        t: [f32; 8],
        triangle: [u32; 8],
    }

    /// Running sums of a pixel, compensated: the true sum is `x + x_carry` (Neumaier / TwoSum).
    struct Sums {
        /// Light that passed through translucent matter.
        subsurface: Vec3,
        subsurface_carry: Vec3,
        /// Light reflected or emitted by the first surface, and the environment where it is shown.
        reflection: Vec3,
        reflection_carry: Vec3,
        /// Samples added.
        samples: u32,
        /// Samples whose camera ray hit the scene.
        covered: u32,
        /// Contributions left out because they were not finite and non-negative, or a sum with them not finite.
        invalid: u32,
    }

    /// A pixel of the finished image. What exceeds f32 is its largest finite number.
    struct Pixel {
        subsurface: Vec3,
        reflection: Vec3,
        /// Variance of the mean of `subsurface`, between batches; 0 with fewer than BATCHES samples.
        variance: Vec3,
        alpha: f32,
        samples: u32,
        invalid: u32,
    }
}

buffers! {
    /// One View.
    Views = 0: VIEWS [View] views;
    /// Compressed wide BVH nodes (Ylitie et al. 2017), five words each, as obvhs lays them out.
    Nodes = 1: NODES [UVec4] nodes;
    /// Triangles in leaf order.
    Triangles = 2: TRIANGLES [Triangle] triangles;
    /// Normals and material of each triangle.
    Shadings = 3: SHADINGS [Shading] shadings;
    /// Materials.
    Materials = 4: MATERIALS [Material] materials;
    /// Delta lights.
    Lights = 5: LIGHTS [Light] lights;
    /// Environment radiance, row by row from the zenith.
    Environment = 6: ENVIRONMENT [Vec3] environment;
    /// Environment sampling: density_height + 1 marginal values, then density_width + 1 for each row, all from 0 to 1.
    EnvironmentCdf = 7: ENVIRONMENT_CDF [f32] environment_cdf;
    /// G-buffer of each batch's current stratum: batch * pixel_count + pixel.
    Surfaces = 8: SURFACES [Surface] surfaces;
    /// One per pixel of the band.
    Probes = 9: PROBES [Probe] probes;
    /// One per pixel of the band.
    HitLists = 10: HIT_LISTS [Hits] hit_lists;
    /// One per pixel of the band.
    RunningSums = 11: RUNNING_SUMS [Sums] running_sums;
    /// Subsurface sum of each batch: batch * pixel_count + pixel. Then, where they are kept, those of reflected light.
    BatchSums = 12: BATCH_SUMS [Vec3] batch_sums;
    /// The finished band.
    Pixels = 13: PIXELS [Pixel] pixels;
    /// Largest number of traversal steps of any invocation, by atomicMax.
    Counters = 14: COUNTERS [u32] counters;
    /// Emissive triangles, by rising index.
    Emitters = 15: EMITTERS [Emitter] emitters;
    /// Of each batch the arguments of an indirect dispatch (three words) and how many pixels see something; then the pixels
    /// to trace, then of each batch those that see something, pixel_count at most.
    Actives = 16: ACTIVES [u32] actives;
    /// 256 numbers, the decoding of sRGB bytes; then the texels of all textures, red in the lowest byte, alpha in the highest.
    Texels = 17: TEXELS [u32] texels;
    /// TEXTURE_KINDS entries for each material.
    Textures = 18: TEXTURES [Texture] textures;
    /// Coordinates of each triangle.
    Coordinates = 19: COORDINATES [Coordinates] coordinates;
    /// Tabulated profiles of the materials that have them; see `table::block`.
    Profiles = 20: PROFILES [Vec3] profiles;
    /// Where the light of each triangle is kept, then of patches of triangles.
    Lattices = 21: LATTICES [Lattice] lattices;
    /// Rows of BOUNDARY_ROW numbers, ROUGH of them for each rough boundary.
    Boundaries = 22: BOUNDARIES [f32] boundaries;
    /// One Progress.
    Progresses = 23: PROGRESSES [Progress] progresses;
    /// MAX_RECORDED samples, of which a recording uses the first.
    Samples = 24: SAMPLES [Sample] samples;
    /// Light (R, G, B) and alpha of each pixel, row by row from the upper left.
    Colors = 25: COLORS [Vec4] colors;
    /// One for each set, where a set holds several materials.
    Mixtures = 26: MIXTURES [Mixture] mixtures;
    /// Balances of each triangle, once for as many materials as its set has.
    Balances = 27: BALANCES [Balance] balances;
    /// The cloud's tree: node i has the children 2 i and 2 i + 1, the leaves are the second half; node 0 is none. Or the
    /// points of Lattices.
    Clusters = 28: CLUSTERS [Cluster] clusters;
    /// One per pixel of the band, where a cloud is gathered by several dispatches.
    Gathers = 29: GATHERS [Gather] gathers;
}

features! {
    /// One of PROJECTION_*.
    projection = 1: PROJECTION,
    /// One of ENVIRONMENT_*.
    environment = 2: ENVIRONMENT_KIND,
    /// 1 where sums of subsurface light are kept by batch, for the variance; 2 where also those of reflected light are.
    batches = 3: BATCHED,
    /// 1 to count traversal steps (tests and benchmarks).
    counters = 4: COUNT_STEPS,
    /// 1 where triangles emit light.
    emitters = 6: EMISSIVE,
    /// Rows of a rough boundary's table: 1, or ROUGHNESS_ROWS where textures change roughness; 0 without such boundaries.
    rough = 9: ROUGH,
    /// Bit k is set where a material has a texture of kind k (TEXTURE_*).
    textures = 7: TEXTURED,
    /// Bit 1 << MODEL_X for each model X of the translucent materials that the scene shows.
    models = 5: MODELS,
    /// 1 where kernels work on lists of pixels, without those that see nothing.
    listed = 8: LISTED,
    /// 1 where profiles depend on the curvature of the surface that is seen.
    curvature = 10: CURVATURE,
    /// 1 where a caller's recordings keep count of the samples on the device.
    recorded = 20: RECORDED,
    /// 1 where a set holds several materials.
    mixtures = 11: MIXED,
    /// One of INTEGRATOR_*.
    integrator = 12: INTEGRATOR,
    /// Width of the tiles in which pixels share their lit hits, a power of 2; 0 where they do not.
    reuse = 13: REUSE,
    /// One of REPROJECT_*.
    reproject = 14: REPROJECT,
    /// One of IRRADIANCE_*.
    irradiance = 15: IRRADIANCE,
    /// Vectors of a cell of tabulated profiles: 1 where both of its values are packed into one f32, 2 where each has its own.
    cell_vectors = 16: CELL_VECTORS,
}

impl Features {
    /// Shadow rays of a sample: one for each delta light, and N in directions from which an environment or an emitter may
    /// shine. Where light is reflected, each of the N is two if there are emitters, one of them to a point of these.
    pub fn rays(&self, view: &View) -> u32 {
        let directions = self.environment != ENVIRONMENT_NONE || self.emitters != 0;
        view.light_count + u32::from(directions) * view.directions
    }
}

impl Probe {
    /// Where the pixel's surface is.
    pub fn position(&self) -> Vec3 {
        Vec3::from_array([self.seat.x, self.seat.y, self.seat.z].map(f32::from_bits))
    }

    /// Squared distance beyond which hits of others are none of its own.
    pub fn reach2(&self) -> f32 {
        f32::from_bits(self.seat.w)
    }

    /// The light that its hit brings to its tile.
    pub fn light(&self) -> Vec3 {
        Vec3::from_array([self.lit.x, self.lit.y, self.lit.z].map(f32::from_bits))
    }

    /// The number that pixels have in common that share their hits; 0 for none.
    pub fn share(&self) -> u32 {
        self.lit.w
    }
}

impl Triangle {
    /// The first vertex, and the edges from it to the second and third; their cross product points out of the matter.
    pub fn corner_and_edges(&self) -> [DVec3; 3] {
        let [a, b, c] = self.vertices.map(|vertex| vertex.as_dvec3());
        [a, b - a, c - a]
    }
}

/// The text of `glsl/shared.glsl`.
pub fn glsl() -> String {
    let mut text = String::from(
        "// What kernels and host share. Written by build.rs from src/shared/mod.rs; do not edit.\n\
         #extension GL_EXT_scalar_block_layout : require\n\
         #extension GL_GOOGLE_include_directive : require\n\
         #extension GL_EXT_control_flow_attributes : require\n\
         layout(local_size_x_id = 0) in;\n\
         #define read_write\n\n",
    );
    glsl_constants(&mut text);
    glsl_features(&mut text);
    glsl_structs(&mut text);
    glsl_buffers(&mut text);
    text.push_str("layout(push_constant, scalar) uniform StepBlock { Step step_; };\n");
    text
}
