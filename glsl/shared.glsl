// What kernels and host share. Written by build.rs from src/shared/mod.rs; do not edit.
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
layout(local_size_x_id = 0) in;
#define read_write

// Invocations of a workgroup unless a caller chooses otherwise (local_size_x_id = 0).
const uint WORKGROUP = 64u;
// Independently scrambled batches of the low-discrepancy points; sample s belongs to batch s % BATCHES.
const uint BATCHES = 8u;
// Consecutive samples of one batch that share a sub-pixel stratum, and so a G-buffer.
const uint STRATUM = 4u;
// Most samples of one recording into a caller's command buffer.
const uint MAX_RECORDED = 4096u;
// Value of `Progress::end` where the sums are to be forgotten.
const uint NO_SAMPLES = 4294967295u;
// Most hits that a probe keeps; of more, this many are kept uniformly at random and reweighted.
const uint MAX_HITS = 8u;
// Most lights of one dispatch of `single`, which takes two rays to each and one more.
const uint MAX_SINGLE = 2u;
// Most shadow rays of one dispatch of `accumulate` or `reflect`, far below Mesa 22's cap of 65,535 loop trips.
const uint MAX_RAYS = 4u;
// Distance along the geometric normal from a surface to the origin of its shadow rays [internal units]: some 30
// roundings of a position. Creases narrower than this are lit as if
// open. `reflect`, which also sees what lies far outside the unit ball, scales it with the triangle's extent there.
const float SHADOW_OFFSET = 3.8146973e-6;
// Part of the way to a point of an emitter that must be free: what stands between the rest, 4e-6 of the distance, and
// another triangle of the emitter that rounding puts there, casts no shadow.
const float EMITTER_REACH = 0.9999962;
// Values of a rough boundary's transmittance, at cosines (i / (BOUNDARY_NODES - 1))^2.
const uint BOUNDARY_NODES = 128u;
// Numbers in a row of a rough boundary's table: the transmittance at the nodes, then what radiance that leaves is
// divided by, 1 - rho_e or 1.
const uint BOUNDARY_ROW = 129u;
// Rows of a boundary whose roughness a texture changes, at the shares (i / (ROUGHNESS_ROWS - 1))^2 of the factor.
const uint ROUGHNESS_ROWS = 33u;
// Least GGX width of an opaque material, which has no mirror.
const float OPAQUE_ALPHA_MIN = 0.001;
// Most media of one set of surfaces that exchange light.
const uint MAX_MEMBERS = 8u;
// Points below one node of the cloud that `gather` starts from at most, so that it stays below Mesa 22's cap of 65,535
// loop trips whatever it opens.
const uint GATHER_POINTS = 4096u;
// Row that stands for the points of the cloud in the keys of random numbers, in which pixels have their own.
const uint POINTS_ROW = 4294967295u;
// Value of `Cluster::set` where points of several sets lie below it.
const uint SEVERAL = 4294967295u;
// Most levels of the BVH, and so entries of a traversal's stack; the host refuses deeper trees.
const uint BVH_DEPTH = 24u;
// Words before the lists of Actives: four for each batch.
const uint ACTIVE_HEADER = 32u;
// Value of `Surface::triangle` for a ray that hits nothing.
const uint MISS = 4294967295u;
// Integrator: probes, whose hits are lit.
const uint INTEGRATOR_SAMPLE = 0u;
// Integrator: points on the surface are lit once, and each pixel gathers from them.
const uint INTEGRATOR_CLOUD = 1u;
// Integrator: points uniform over the area of the surface, on the host.
const uint INTEGRATOR_AREA = 2u;
// Integrator: random walks through the matter, on the host.
const uint INTEGRATOR_WALK = 3u;
// Projection: all techniques combined by the balance heuristic.
const uint PROJECTION_MIS = 0u;
// Projection: the camera ray alone, first hit, as the method was given.
const uint PROJECTION_CAMERA = 1u;
// Projection: the normal axis alone, all hits.
const uint PROJECTION_NORMAL = 2u;
// Reproject: rays are traced through the scene.
const uint REPROJECT_TRACE = 0u;
// Reproject: points are looked up in the G-buffer.
const uint REPROJECT_SCREEN = 1u;
// Irradiance: shadow rays from each hit.
const uint IRRADIANCE_DIRECT = 0u;
// Irradiance: interpolated between points of the surface, which are lit once.
const uint IRRADIANCE_CACHED = 1u;
// Looking up: pixels' widths between a hit in the plane of the triangle that a pixel sees and the point of it that the
// pixel sees, at most.
const float SCREEN_REACH = 4.0;
// Model: the standard dipole of Jensen et al. 2001.
const uint MODEL_STANDARD = 0u;
// Model: the better dipole of d'Eon 2012.
const uint MODEL_BETTER = 1u;
// Model: the directional dipole of Frisvad et al. 2014, which also depends on where light comes from.
const uint MODEL_DIRECTIONAL = 2u;
// Model: normalised diffusion of Christensen and Burley 2015.
const uint MODEL_BURLEY = 3u;
// Model: profiles tabulated by simulation.
const uint MODEL_TABLE = 4u;
// Model: the opaque limit, where light leaves where it entered.
const uint MODEL_LAMBERT = 5u;
// Bits of an f32 below those that number a cell of a tabulated profile.
const uint TABLE_SHIFT = 21u;
// Vectors before a table's cells at each curvature.
const uint TABLE_HEADER = 3u;
// Bits of each of the two values of a table's packed cell.
const uint TABLE_BITS = 12u;
// Most halvings in the search of a distribution function, for at most 500 cells.
const uint TABLE_HALVINGS = 9u;
// Most curvatures of a table.
const uint TABLE_NODES = 40u;
// Radius below which normalised diffusion, which is infinite at 0, counts as there [internal units].
const float BURLEY_RADIUS_MIN = 1e-15;
// No environment.
const uint ENVIRONMENT_NONE = 0u;
// The same radiance from everywhere.
const uint ENVIRONMENT_CONSTANT = 1u;
// A latitude-longitude image.
const uint ENVIRONMENT_IMAGE = 2u;
// Material flag: light enters and leaves through this surface (a BSSRDF).
const uint TRANSLUCENT = 1u;
// Material flag: the directional dipole is averaged with itself, light and eye exchanged.
const uint RECIPROCAL = 256u;
// Material flag: the surface's emission lights both sides, not only the one from which its vertices run
// counter-clockwise.
const uint TWO_SIDED = 2u;
// Light kind: position and intensity [W/sr].
const uint LIGHT_POINT = 0u;
// Light kind: a point light with a cone.
const uint LIGHT_SPOT = 1u;
// Light kind: direction and perpendicular irradiance [W/m^2].
const uint LIGHT_DIRECTIONAL = 2u;
// Kind of texture: base colour (sRGB).
const uint TEXTURE_BASE_COLOR = 0u;
// Kind of texture: metallic in blue, roughness in green.
const uint TEXTURE_METALLIC_ROUGHNESS = 1u;
// Kind of texture: normals in the tangent frame; `Texture::scale` multiplies x and y.
const uint TEXTURE_NORMAL = 2u;
// Kind of texture: emitted light (sRGB).
const uint TEXTURE_EMISSION = 3u;
// Kind of texture: multi-scatter colour (sRGB).
const uint TEXTURE_SCATTER_COLOR = 4u;
// Kind of texture: scatter strength in alpha.
const uint TEXTURE_SCATTER_STRENGTH = 5u;
// Kind of texture: a surface is where alpha times `Texture::scale` is at least 1.
const uint TEXTURE_ALPHA = 6u;
// Kinds of texture, each an entry of every material.
const uint TEXTURE_KINDS = 7u;
// Beyond the edge a texture repeats.
const uint WRAP_REPEAT = 0u;
// Beyond the edge a texture goes on with its last texel.
const uint WRAP_CLAMP = 1u;
// Beyond the edge a texture repeats in mirror images.
const uint WRAP_MIRROR = 2u;
// Steps of a material's ramp, along which textures move its medium.
const uint RAMP = 512u;
// Share of camera rays among the probes of all techniques combined, where the camera looks onto the surface. This and
// the next by measured squared errors of six scenes (a slab, balls, Spot; 8 samples, tiles): .25 and .25 have 0 to 11 %
// less, but on a flat place under tiles 40 % more; .15 and .25, .1 and .33 or .4 and .15 more on some and less on
// others; .55 and .15 a quarter more.
const float CAMERA_FRACTION = 0.4;
// Share of the two tangents among the rest.
const float TANGENT_FRACTION = 0.33333334;
// Cosine of view below which the share of camera rays falls.
const float CAMERA_FADE = 0.3;
// GGX width below which a surface is a mirror: D, of the order 1 / alpha^2, would leave f32.
const float MIRROR_ALPHA = 1e-6;
// Dimension: radius.
const uint DIM_RADIUS = 0u;
// Dimension: angle in the tangent plane.
const uint DIM_ANGLE = 1u;
// Dimension: technique (axis).
const uint DIM_TECHNIQUE = 2u;
// Dimension: component of the radial density (channel and source).
const uint DIM_COMPONENT = 3u;
// Dimension: which hit of the probe is lit.
const uint DIM_HIT = 4u;
// Coordinates of the point that the host computes for each sample: the dimensions above.
const uint DIMENSIONS = 5u;
// Dimensions 5 and 6: position within the pixel (a point per stratum, not per sample).
const uint DIM_PIXEL = 5u;
// Dimensions 7 and 8: environment direction at the exit (a point per direction).
const uint DIM_LIGHT = 7u;
// Dimensions 9 and 10: environment direction at the first surface (a point per direction).
const uint DIM_REFLECT = 9u;
// Dimension of the hash that keeps hits beyond MAX_HITS.
const uint DIM_OVERFLOW = 11u;
// Dimensions 12 and 13: point of an emitter for the exit (a point per direction).
const uint DIM_EMITTER = 12u;
// Dimensions 14 and 15: point of an emitter for the first surface (a point per direction).
const uint DIM_EMITTER_REFLECT = 14u;
// Dimensions 16 and 17: channel and depth of single scattering (`point` 0 and 1, scrambled otherwise).
const uint DIM_SINGLE = 16u;
// Dimensions 18 and 19: environment direction at that point (a point per direction).
const uint DIM_SINGLE_LIGHT = 18u;
// Dimensions 20 and 21: point of an emitter for that point (a point per direction).
const uint DIM_SINGLE_EMITTER = 20u;
// Dimension of the hash that draws where tabulated profiles of a tile's hits are read.
const uint DIM_REUSE = 22u;
// Dimension: whether a ray goes to a point of an emitter, for the exit (a number per direction).
const uint DIM_SOURCE = 23u;
// Dimension: the same, for single scattering.
const uint DIM_SINGLE_SOURCE = 24u;
// 2^32 over the golden ratio: the step of numbers that cover [0, 1) evenly.
const uint GOLDEN = 2654435769u;
// Added to a dimension for what the place in a tile brings to it.
const uint DIM_PLACE = 32u;
// Of `functions`: x y + z, x / y and sqrt |x|, for what the device's arithmetic is.
const uint FUNCTION_ARITHMETIC = 0u;
// Of `functions`: dot, length and cross product.
const uint FUNCTION_DOT = 1u;
// Of `functions`: `hash`.
const uint FUNCTION_HASH = 2u;
// Of `functions`: `scramble`.
const uint FUNCTION_SCRAMBLE = 3u;
// Of `functions`: `sobol1`.
const uint FUNCTION_SOBOL = 4u;
// Of `functions`: `dimension_key` of `pixel_key`.
const uint FUNCTION_KEY = 5u;
// Of `functions`: `random_point`.
const uint FUNCTION_POINT = 6u;
// Of `functions`: `exp_`.
const uint FUNCTION_EXP = 7u;
// Of `functions`: `log_`.
const uint FUNCTION_LOG = 8u;
// Of `functions`: `log1p_`.
const uint FUNCTION_LOG1P = 9u;
// Of `functions`: `one_minus_exp_over`.
const uint FUNCTION_ONE_MINUS_EXP_OVER = 10u;
// Of `functions`: `cos_sin_2pi`.
const uint FUNCTION_COS_SIN = 11u;
// Of `functions`: `atan2_`.
const uint FUNCTION_ATAN2 = 12u;
// Of `functions`: `orthonormal_basis`.
const uint FUNCTION_BASIS = 13u;
// Of `functions`: `fresnel`.
const uint FUNCTION_FRESNEL = 14u;
// Of `functions`: `crossing` and `leaving_share`.
const uint FUNCTION_CROSSING = 15u;
// Of `functions`: `ggx_distribution` and `ggx_lambda`.
const uint FUNCTION_GGX = 16u;
// Of `functions`: `draw_half_vector`.
const uint FUNCTION_HALF_VECTOR = 17u;
// Of `functions`: `refracted`.
const uint FUNCTION_REFRACTED = 18u;
// Of `functions`: `phase`.
const uint FUNCTION_PHASE = 19u;
// Of `functions`: `draw_phase`.
const uint FUNCTION_DRAW_PHASE = 20u;
// Of `functions`: `texture_at`, colour.
const uint FUNCTION_TEXTURE = 21u;
// Of `functions`: `texture_at`, alpha.
const uint FUNCTION_TEXTURE_ALPHA = 22u;
// Of `functions`: `delta_light`, irradiance.
const uint FUNCTION_DELTA_LIGHT = 23u;
// Of `functions`: `delta_light`, direction.
const uint FUNCTION_LIGHT_DIRECTION = 24u;
// Of `functions`: `environment_radiance`.
const uint FUNCTION_ENVIRONMENT = 25u;
// Of `functions`: `environment_density`.
const uint FUNCTION_ENVIRONMENT_DENSITY = 26u;
// Of `functions`: `draw_environment`.
const uint FUNCTION_DRAW_ENVIRONMENT = 27u;
// Of `functions`: `draw_cosine`.
const uint FUNCTION_DRAW_COSINE = 28u;
// Of `functions`: `draw_emitter`.
const uint FUNCTION_DRAW_EMITTER = 29u;
// Of `functions`: `emitter_density` in `combined`.
const uint FUNCTION_EMITTER_DENSITY = 30u;
// Of `functions`: `shape_shifted`.
const uint FUNCTION_SHAPE = 31u;
// Of `functions`: `draw_radius` and `radial_density`.
const uint FUNCTION_RADIUS = 32u;
// Of `functions`: `directional_value`.
const uint FUNCTION_DIRECTIONAL = 33u;
// Of `functions`: `obliqueness`.
const uint FUNCTION_OBLIQUENESS = 34u;
// Of `functions`: `pick_member`.
const uint FUNCTION_PICK = 35u;
// Of `functions`: `technique_fractions`.
const uint FUNCTION_FRACTIONS = 36u;
// Of `functions`: `seen`.
const uint FUNCTION_SEEN = 37u;
// Of `functions`: `mixture_density` and `camera_ratio`.
const uint FUNCTION_DENSITY = 38u;
// Of `functions`: `traverse` for the nearest hit.
const uint FUNCTION_CLOSEST = 39u;
// Of `functions`: `traverse` for any hit.
const uint FUNCTION_ANY = 40u;
// Of `functions`: `traverse` for all hits.
const uint FUNCTION_ALL = 41u;
// Of `functions`: `compensated_add`.
const uint FUNCTION_ADD = 42u;

// One of PROJECTION_*.
layout(constant_id = 1) const uint PROJECTION = 0;
// One of ENVIRONMENT_*.
layout(constant_id = 2) const uint ENVIRONMENT_KIND = 0;
// 1 where sums of subsurface light are kept by batch, for the variance; 2 where also those of reflected light are.
layout(constant_id = 3) const uint BATCHED = 0;
// 1 to count traversal steps (tests and benchmarks).
layout(constant_id = 4) const uint COUNT_STEPS = 0;
// 1 where triangles emit light.
layout(constant_id = 6) const uint EMISSIVE = 0;
// Rows of a rough boundary's table: 1, or ROUGHNESS_ROWS where textures change roughness; 0 without such boundaries.
layout(constant_id = 9) const uint ROUGH = 0;
// Bit k is set where a material has a texture of kind k (TEXTURE_*).
layout(constant_id = 7) const uint TEXTURED = 0;
// Bit 1 << MODEL_X for each model X of the translucent materials that the scene shows.
layout(constant_id = 5) const uint MODELS = 0;
// 1 where kernels work on lists of pixels, without those that see nothing.
layout(constant_id = 8) const uint LISTED = 0;
// 1 where profiles depend on the curvature of the surface that is seen.
layout(constant_id = 10) const uint CURVATURE = 0;
// 1 where a caller's recordings keep count of the samples on the device.
layout(constant_id = 20) const uint RECORDED = 0;
// 1 where a set holds several materials.
layout(constant_id = 11) const uint MIXED = 0;
// One of INTEGRATOR_*.
layout(constant_id = 12) const uint INTEGRATOR = 0;
// Width of the tiles in which pixels share their lit hits, a power of 2; 0 where they do not.
layout(constant_id = 13) const uint REUSE = 0;
// One of REPROJECT_*.
layout(constant_id = 14) const uint REPROJECT = 0;
// One of IRRADIANCE_*.
layout(constant_id = 15) const uint IRRADIANCE = 0;
// Vectors of a cell of tabulated profiles: 1 where both of its values are packed into one f32, 2 where each has its own.
layout(constant_id = 16) const uint CELL_VECTORS = 0;

// What is constant over a render: camera, pixels, environment, counts.
struct View {
    // A point on the camera's axis near the scene's centre; rays pass through the plane there.
    vec3 pivot;
    // From the pivot to the right edge of the full image, in that plane.
    vec3 right;
    // From the pivot to the upper edge of the full image.
    vec3 up;
    // From the eye to the pivot (perspective); a unit vector (orthographic).
    vec3 forward;
    // 1 for a perspective camera, 0 for an orthographic one.
    float perspective;
    // Orthographic only: distance from the camera's plane to the pivot's.
    float reach;
    // Width of the full image (pixels).
    uint width;
    // Height of the full image (pixels).
    uint height;
    // First column that is rendered.
    uint crop_x;
    // Columns that are rendered.
    uint crop_width;
    // Key of all random numbers.
    uint seed;
    // Incoming directions at each position, N, of the environment and of emitters.
    uint directions;
    // Delta lights in the scene.
    uint light_count;
    // Triangles that emit light.
    uint emitter_count;
    // Centre of a ball around them.
    vec3 emitters_centre;
    // Square of its radius.
    float emitters_radius2;
    // 1 to add the environment where a camera ray hits nothing.
    uint show_environment;
    // Tiles: twice the number of sets.
    uint groups;
    // Leaves of the cloud's tree, a power of two.
    uint leaves;
    // Radius over distance below which a cluster's centre stands for its points.
    float opening;
    // Constant radiance, or the factor on the image's.
    vec3 environment_scale;
    // World direction to image direction: rows of a rotation.
    vec3 environment_row0;
    vec3 environment_row1;
    vec3 environment_row2;
    // Texels of the environment image.
    uint environment_width;
    uint environment_height;
    // Cells of the environment's sampling density.
    uint density_width;
    uint density_height;
};

// What changes from dispatch to dispatch (push constants, at most 128 bytes).
struct Step {
    // First pixel row of the band, in the full image.
    uint first_row;
    // Pixels in the band.
    uint pixel_count;
    // Index of the sample: number sample_index / BATCHES of batch sample_index % BATCHES. In a recording, the sample's
    // position in it; for `begin`, the start of the recording's range.
    uint sample_index;
    // 1 to trace `primary` through the pixel's centre, for the AOVs.
    uint pixel_centre;
    // First shadow ray of this dispatch: delta lights first, then directions.
    uint ray_begin;
    // Shadow rays of this dispatch; 0 where the scene has no light.
    uint ray_count;
    // 1 in the sample's first dispatch of `reflect`, which also adds what does not depend on shadow rays, and of
    // `gather`, which begins its sums.
    uint first;
    // 1 in the sample's last dispatch of `gather`.
    uint last;
    // 1 in the sample's first dispatch of all that add to the sums: it counts whether the pixel is covered. Of `count`,
    // the samples that it adds.
    uint count;
    // Pixels that `primary` and `count` take from the list of those to trace; 0 for all of the band.
    uint traced;
    // First sample in the sums, for `resolve`; of those that light the cloud.
    uint range_begin;
    // End of those that light the cloud.
    uint range_end;
    // Node of the cloud's tree: the first one of `cluster`'s level, the one that `gather` starts from. The first of the
    // points that `irradiance` lights.
    uint node;
    // The unscrambled point number sample_index / BATCHES of the sequence, dimensions 0 to DIMENSIONS - 1.
    uint point[5];
};

// Which samples the sums hold, where recordings keep count of them (`RECORDED`).
struct Progress {
    // Added to the range of every recording.
    uint first;
    // First sample of the sums.
    uint begin;
    // End of the samples of the sums; NO_SAMPLES where they are to be forgotten.
    uint end;
    // 1 where the recording that runs started new sums.
    uint restart;
};

// A sample of the recording that runs, written by `begin`.
struct Sample {
    // As `Step::sample_index` without recordings.
    uint index;
    // As `Step::point` without recordings.
    uint point[5];
};

// A triangle in the order of the BVH's leaves, for traversal.
struct Triangle {
    // Counter-clockwise as seen from outside the matter; triangles that share a vertex have its very bits.
    vec3 vertices[3];
    // The set of surfaces that exchange light, to which it belongs.
    uint set;
};

// What shading needs of a triangle, in the same order.
struct Shading {
    // Interpolated (unit, outward) normals at the three vertices.
    vec3 normal0;
    vec3 normal1;
    vec3 normal2;
    // Index of the material.
    uint material;
};

// A material as kernels read it. A model's profile is strength x shape(r); its file in `reference::profile` says
// which of the numbers it uses. Directional dipole: shape and strength of the standard dipole choose hits and radii.
struct Material {
    // Rate of each channel's exponential [1/length]: sigma_tr of the dipoles, 1/d of normalised diffusion.
    vec3 sigma_tr;
    // Dipoles: depth of the real source z_r of each channel.
    vec3 z_real;
    // Dipoles: height of the virtual source z_v of each channel (positive).
    vec3 z_virtual;
    // Better dipole: the fluence's part over the flux's, C_phi / (C_E D) [1/length].
    vec3 fluence;
    // Directional dipole: 2 A d_e, the height of the virtual source over the modified tangent plane.
    vec3 height;
    // Directional dipole: 1 / (3 sigma_t), with sigma_t not reduced.
    vec3 free_path;
    // Directional dipole: kappa / (3 sigma_t), the least that keeps its real source from the exit.
    vec3 floor;
    // Directional dipole: what stands before its maximum, with the renormalisation.
    vec3 beam;
    // Directional dipole: C_phi.
    float c_phi;
    // Directional dipole: C_E.
    float c_e;
    // Radiance per unit shape(r) and unit flux that entered: for dipoles alpha'/2 / (pi (1 - rho_e)); /pi alone for
    // jensen2001; without either where sets hold several materials.
    vec3 strength;
    // Channel probability over the shape's integral, b_c / mass_c: the density of r is dot(density, shape(r)).
    vec3 density;
    // Cumulative probability of the sampler's nine components, three of each channel; see `reference::profile`. All 0
    // where no radius is drawn.
    float component_cdf[9];
    // One of MODEL_*.
    uint model;
    // Radius of the ball in which probes look for surfaces.
    float radius_max;
    // Rate of the camera projection's exponential: the smallest at which a channel's profile falls [1/length].
    float camera_rate;
    // Index of refraction, inside over outside.
    float ior;
    // Extinction sigma_t, not reduced, for single scattering [1/length].
    vec3 extinction;
    // Scattering sigma_s, not reduced [1/length]; 0 where single scattering is not added.
    vec3 scattering;
    // Mean cosine of the phase function.
    vec3 g;
    // GGX width alpha = roughness^2; 0 is a smooth mirror.
    float alpha;
    // Linear base colour of an opaque material.
    vec3 base_color;
    float metallic;
    // Emitted radiance.
    vec3 emission;
    // Table: its first number, first cell of the squared distance, cells and curvatures.
    uint table;
    uint table_first;
    uint table_cells;
    uint table_nodes;
    // Table, and its opaque limit: mean of 1 - cosine of refraction over diffuse light that enters.
    float obliqueness;
    // Opaque limit of a table: slope of the total in 1 - cosine of refraction.
    vec3 slope;
    // Table: the number of triangle 0 in Balances, for this material's profile.
    uint balance;
    // Of TRANSLUCENT, TWO_SIDED and RECIPROCAL.
    uint flags;
    // First of RAMP + 1 materials whose medium goes from black to this one's; 0 where no texture changes it.
    uint ramp;
    // 1 + the number of its table in Boundaries; 0 for a smooth boundary.
    uint boundary;
    // Cloud: radius within which light is interpolated between points.
    float reach;
    // Where sets hold several materials: what strength and beam leave out and the exit's material brings, its tint over
    // pi (1 - rho_e).
    vec3 exit;
};

// What a material's tabulated profile needs of a triangle, at the three vertices.
struct Balance {
    // Factors with which the profile gives back what its sphere does.
    vec3 at[3];
    // 1 over the radius of the sphere that the body resembles there.
    vec3 curvature;
};

// A point whose light is kept, as of the cloud (a leaf), or what the points below a node of its tree have in common.
struct Cluster {
    // Of several points, the mean by flux.
    vec3 position;
    // Geometric normal, of several points the mean by flux; 0 where they have none.
    vec3 normal;
    // Distance within which all of its points are.
    float radius;
    // Mean squared distance of its points from that, by flux.
    float spread;
    // Flux that enters: of table models, at slope 0.
    vec3 flux;
    // Flux times 1 - cosine of refraction, which the slope of table models multiplies.
    vec3 oblique;
    // Area that its points stand for; 0 for a leaf without a point.
    float area;
    // Near mass times area.
    vec3 mass;
    // The set that they belong to, or SEVERAL.
    uint set;
    // Of a leaf: its triangle, and the weights of the second and third vertex.
    uint triangle;
    vec2 barycentric;
};

// Points of a triangle, or of one of the patches that it is cut into, whose light is kept: b1 = i / cells,
// b2 = j / cells with whole numbers i + j <= cells.
struct Lattice {
    // Patches along each edge; 1 for a triangle that is not cut. Patches by rising j, then i, the lower one before
    // the upper one: they follow in Lattices from `first` on, and there is nothing else here.
    uint patches;
    // Cells along each edge; 0 for a triangle that lets no light in, or is in the opaque limit.
    uint cells;
    // The points at its three vertices, which triangles around a vertex share. Of an upper patch the first is the one
    // with the largest b1 and b2, then follows that with the largest b2.
    uint corners[3];
    // The first of its other points: by rising j, then i.
    uint first;
};

// What a pixel has gathered so far.
struct Gather {
    // From afar.
    vec3 far;
    // Weighted light and weights of the points that are near.
    vec3 near;
    vec3 weight;
    // Weighted near masses.
    vec3 mass;
};

// The media of a set of several materials.
struct Mixture {
    // A material of each medium that scatters; radii are drawn from each with the same probability.
    uint members[8];
    uint count;
    // Largest radius_max of the members.
    float radius_max;
    // Smallest camera_rate of the members.
    float camera_rate;
};

// One texture of a material. Texel (0, 0) is the upper left one, at the coordinates (0, 0).
struct Texture {
    // Texels in a row; 0 where the material has no texture of the kind.
    uint width;
    uint height;
    // Its first word in Texels.
    uint offset;
    // 1 where red, green and blue are sRGB-encoded.
    uint srgb;
    // WRAP_* across and down.
    uint wrap_u;
    uint wrap_v;
    // 1 to interpolate between texels, 0 to take the nearest.
    uint linear;
    // Which of a triangle's two coordinates it uses.
    uint set;
    // The rows of the affine map from the triangle's coordinates to the texture's.
    vec3 row_u;
    vec3 row_v;
    // What its kind says.
    float scale;
};

// What textures need to know of a triangle.
struct Coordinates {
    // Texture coordinates of the three vertices: set 0, then set 1.
    vec2 uv[6];
    // Direction of growing u at the vertices; 0 where there is none.
    vec3 tangent[3];
    // 1 or -1: the bitangent is this times normal x tangent.
    float handedness;
    // Index of the material.
    uint material;
};

// A delta light.
struct Light {
    vec3 position;
    // Unit vector in which the light shines (spot, directional).
    vec3 direction;
    // Point and spot: intensity x (internal units per metre)^2. Directional: perpendicular irradiance.
    vec3 intensity;
    // LIGHT_POINT, LIGHT_SPOT or LIGHT_DIRECTIONAL.
    uint kind;
    // Spot: the angular factor is saturate(cosine * scale + offset)^2.
    float spot_scale;
    float spot_offset;
    // KHR_lights_punctual range: factor max(1 - (d * inverse_range)^4, 0); 0 is infinite range.
    float inverse_range;
};

// A triangle that emits light.
struct Emitter {
    uint triangle;
    // Probability that a point is drawn on it, over its area.
    float density;
    // Probability of those before it, and with its own; multiples of 2^-24.
    float cumulative[2];
};

// The surface a camera ray meets first (the G-buffer), written by `primary`.
struct Surface {
    vec3 position;
    // Triangle, or MISS.
    uint triangle;
    // Weights of the second and third vertex.
    vec2 barycentric;
};

// A probe ray, written by `sample`: all points `xo + offset + t * direction` with t in [t_min, t_max].
struct Probe {
    // From xo to the ray's origin.
    vec3 offset;
    // Unit vector.
    vec3 direction;
    float t_min;
    // Below t_min for a pixel without a probe.
    float t_max;
    // Camera projection only: radius in the tangent plane.
    float radius;
    // Tiles only. Bits of xo, and of the squared distance beyond which the pixel's profile, or the ball of its probes,
    // ends.
    uvec4 seat;
    // Tabulated profile at the surface that is seen: the first of two curvatures, its weight, how distances bend for
    // both, and 1/4a^2.
    uint table_node;
    float table_weight;
    vec2 table_bend;
    float table_scale;
    // Written by `accumulate`: the hit that is lit, and its squared distance from xo.
    vec3 hit;
    float hit_r2;
    // Tiles only. Bits of the hit's light over the tile's weights, which `accumulate` writes; and (1 + sample) x
    // View::groups + 2 x the set, and 1 more where its inner side is seen: pixels that have the same share hits, also
    // without a probe; 0 for none.
    uvec4 lit;
};

// Where a probe meets surfaces of its set, written by `reproject`.
struct Hits {
    // Hits found; the first min(count, MAX_HITS) entries are set.
    uint count;
    float t[8];
    uint triangle[8];
};

// Running sums of a pixel, compensated: the true sum is `x + x_carry` (Neumaier / TwoSum).
struct Sums {
    // Light that passed through translucent matter.
    vec3 subsurface;
    vec3 subsurface_carry;
    // Light reflected or emitted by the first surface, and the environment where it is shown.
    vec3 reflection;
    vec3 reflection_carry;
    // Samples added.
    uint samples;
    // Samples whose camera ray hit the scene.
    uint covered;
    // Contributions left out because they were not finite and non-negative, or a sum with them not finite.
    uint invalid;
};

// A pixel of the finished image. What exceeds f32 is its largest finite number.
struct Pixel {
    vec3 subsurface;
    vec3 reflection;
    // Variance of the mean of `subsurface`, between batches; 0 with fewer than BATCHES samples.
    vec3 variance;
    float alpha;
    uint samples;
    uint invalid;
};

// One View.
#define VIEWS(access) layout(set = 0, binding = 0, scalar) access buffer ViewsBlock { View views[]; }
// Compressed wide BVH nodes (Ylitie et al. 2017), five words each, as obvhs lays them out.
#define NODES(access) layout(set = 0, binding = 1, scalar) access buffer NodesBlock { uvec4 nodes[]; }
// Triangles in leaf order.
#define TRIANGLES(access) layout(set = 0, binding = 2, scalar) access buffer TrianglesBlock { Triangle triangles[]; }
// Normals and material of each triangle.
#define SHADINGS(access) layout(set = 0, binding = 3, scalar) access buffer ShadingsBlock { Shading shadings[]; }
// Materials.
#define MATERIALS(access) layout(set = 0, binding = 4, scalar) access buffer MaterialsBlock { Material materials[]; }
// Delta lights.
#define LIGHTS(access) layout(set = 0, binding = 5, scalar) access buffer LightsBlock { Light lights[]; }
// Environment radiance, row by row from the zenith.
#define ENVIRONMENT(access) layout(set = 0, binding = 6, scalar) access buffer EnvironmentBlock { vec3 environment[]; }
// Environment sampling: density_height + 1 marginal values, then density_width + 1 for each row, all from 0 to 1.
#define ENVIRONMENT_CDF(access) layout(set = 0, binding = 7, scalar) access buffer EnvironmentCdfBlock { float environment_cdf[]; }
// G-buffer of each batch's current stratum: batch * pixel_count + pixel.
#define SURFACES(access) layout(set = 0, binding = 8, scalar) access buffer SurfacesBlock { Surface surfaces[]; }
// One per pixel of the band.
#define PROBES(access) layout(set = 0, binding = 9, scalar) access buffer ProbesBlock { Probe probes[]; }
// One per pixel of the band.
#define HIT_LISTS(access) layout(set = 0, binding = 10, scalar) access buffer HitListsBlock { Hits hit_lists[]; }
// One per pixel of the band.
#define RUNNING_SUMS(access) layout(set = 0, binding = 11, scalar) access buffer RunningSumsBlock { Sums running_sums[]; }
// Subsurface sum of each batch: batch * pixel_count + pixel. Then, where they are kept, those of reflected light.
#define BATCH_SUMS(access) layout(set = 0, binding = 12, scalar) access buffer BatchSumsBlock { vec3 batch_sums[]; }
// The finished band.
#define PIXELS(access) layout(set = 0, binding = 13, scalar) access buffer PixelsBlock { Pixel pixels[]; }
// Largest number of traversal steps of any invocation, by atomicMax.
#define COUNTERS(access) layout(set = 0, binding = 14, scalar) access buffer CountersBlock { uint counters[]; }
// Emissive triangles, by rising index.
#define EMITTERS(access) layout(set = 0, binding = 15, scalar) access buffer EmittersBlock { Emitter emitters[]; }
// Of each batch the arguments of an indirect dispatch (three words) and how many pixels see something; then the pixels
// to trace, then of each batch those that see something, pixel_count at most.
#define ACTIVES(access) layout(set = 0, binding = 16, scalar) access buffer ActivesBlock { uint actives[]; }
// 256 numbers, the decoding of sRGB bytes; then the texels of all textures, red in the lowest byte, alpha in the highest.
#define TEXELS(access) layout(set = 0, binding = 17, scalar) access buffer TexelsBlock { uint texels[]; }
// TEXTURE_KINDS entries for each material.
#define TEXTURES(access) layout(set = 0, binding = 18, scalar) access buffer TexturesBlock { Texture textures[]; }
// Coordinates of each triangle.
#define COORDINATES(access) layout(set = 0, binding = 19, scalar) access buffer CoordinatesBlock { Coordinates coordinates[]; }
// Tabulated profiles of the materials that have them; see `table::block`.
#define PROFILES(access) layout(set = 0, binding = 20, scalar) access buffer ProfilesBlock { vec3 profiles[]; }
// Where the light of each triangle is kept, then of patches of triangles.
#define LATTICES(access) layout(set = 0, binding = 21, scalar) access buffer LatticesBlock { Lattice lattices[]; }
// Rows of BOUNDARY_ROW numbers, ROUGH of them for each rough boundary.
#define BOUNDARIES(access) layout(set = 0, binding = 22, scalar) access buffer BoundariesBlock { float boundaries[]; }
// One Progress.
#define PROGRESSES(access) layout(set = 0, binding = 23, scalar) access buffer ProgressesBlock { Progress progresses[]; }
// MAX_RECORDED samples, of which a recording uses the first.
#define SAMPLES(access) layout(set = 0, binding = 24, scalar) access buffer SamplesBlock { Sample samples[]; }
// Light (R, G, B) and alpha of each pixel, row by row from the upper left.
#define COLORS(access) layout(set = 0, binding = 25, scalar) access buffer ColorsBlock { vec4 colors[]; }
// One for each set, where a set holds several materials.
#define MIXTURES(access) layout(set = 0, binding = 26, scalar) access buffer MixturesBlock { Mixture mixtures[]; }
// Balances of each triangle, once for as many materials as its set has.
#define BALANCES(access) layout(set = 0, binding = 27, scalar) access buffer BalancesBlock { Balance balances[]; }
// The cloud's tree: node i has the children 2 i and 2 i + 1, the leaves are the second half; node 0 is none. Or the
// points of Lattices.
#define CLUSTERS(access) layout(set = 0, binding = 28, scalar) access buffer ClustersBlock { Cluster clusters[]; }
// One per pixel of the band, where a cloud is gathered by several dispatches.
#define GATHERS(access) layout(set = 0, binding = 29, scalar) access buffer GathersBlock { Gather gathers[]; }

layout(push_constant, scalar) uniform StepBlock { Step step_; };
