//! What a caller may choose about a render.

use crate::{shared, timeline::Timeline};
use std::{fmt, str::FromStr};

/// How a sampled point of the tangent plane is carried to the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Projection {
    /// Normal, camera and two tangent axes, combined by the balance heuristic: unbiased, finite variance.
    #[default]
    Mis = shared::PROJECTION_MIS,
    /// The camera ray alone, first hit, exponential radius: the method as it was given, with its bias.
    Camera = shared::PROJECTION_CAMERA,
    /// The normal axis alone, all hits: unbiased, log-infinite variance on curved surfaces.
    Normal = shared::PROJECTION_NORMAL,
}

/// Where a sampled point meets the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Reproject {
    /// Where a ray through the scene does.
    #[default]
    Trace = shared::REPROJECT_TRACE,
    /// Where a G-buffer says: the camera ray through the point meets the surface that the pixel there sees. Fast, with a
    /// bias: light that enters where the camera does not see is missing, as is what lies outside the image or the
    /// [crop](Settings::crop), and the place is known to about a pixel, so
    /// that it may lie below the surface where triangles meet, in their own shadow. Every probe takes the camera's technique, with
    /// [`Projection::Mis`] from the profile's own radii; see [`reference::screen`](crate::reference::screen).
    ///
    /// The image is one band, whatever [`Settings::band_pixels`] says. Of [`Integrator::Sample`] alone; not for
    /// [`Projection::Normal`], nor for an error as goal ([`Renderer::render_until`](crate::Renderer::render_until)).
    Screen = shared::REPROJECT_SCREEN,
}

impl Reproject {
    /// Every choice, with its name on the command line.
    pub const NAMES: [(Reproject, &str); 2] = [(Reproject::Trace, "trace"), (Reproject::Screen, "screen")];
}

impl fmt::Display for Reproject {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let (_, name) = Reproject::NAMES.iter().find(|(it, _)| it == self).expect("every choice has a name");
        out.pad(name)
    }
}

/// How the light is found that enters at a sampled point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Irradiance {
    /// By shadow rays of each sample.
    #[default]
    Direct = shared::IRRADIANCE_DIRECT,
    /// Between points of the surface that are lit once, before the first sample ([`cache`](mod@crate::cache)): a look-up takes the
    /// place of shadow rays, however many [`Settings::directions`] there are. Its error is that of linear interpolation
    /// between points, which moves the edge of a shadow by up to half their distance; and the noise left in the points'
    /// light, which no number of samples of the image reduces and its variance does not hold.
    ///
    /// Of [`Integrator::Sample`] alone; not for the directional dipole, whose value depends on where light comes from, nor
    /// for recordings. Matter in the opaque limit, which spreads no light, and light that enters on the inner side of
    /// surfaces stay as they are with [`Irradiance::Direct`].
    Cached = shared::IRRADIANCE_CACHED,
}

impl Irradiance {
    /// Every choice, with its name on the command line.
    pub const NAMES: [(Irradiance, &str); 2] = [(Irradiance::Direct, "direct"), (Irradiance::Cached, "cached")];
}

impl fmt::Display for Irradiance {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let (_, name) = Irradiance::NAMES.iter().find(|(it, _)| it == self).expect("every choice has a name");
        out.pad(name)
    }
}

/// How fine [`Irradiance::Cached`] is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cache {
    /// Most points, 0 to [`Cache::POINTS_MAX`], besides those at the vertices, which there always are.
    pub points: u32,
    /// Samples that light each point, of [`Settings::directions`] directions and points of emitters each; at least 2, so
    /// that differences can be told from noise. Delta lights need none.
    pub samples: u32,
    /// Distance between points that is fine enough, in mean free paths; positive. Where light hardly varies they are four
    /// times as far apart.
    pub spacing: f64,
    /// Points are added to a triangle whose light differs between neighbouring ones by more than this share of the light's
    /// root mean square over all vertices; not negative. 0 makes all as fine as they get.
    pub tolerance: f64,
}

impl Cache {
    /// As many as every device's binding holds.
    pub const POINTS_MAX: u32 = 1 << 19;
}

impl Default for Cache {
    fn default() -> Self {
        Cache { points: 1 << 17, samples: 32, spacing: 0.5, tolerance: 0.1 }
    }
}

/// What computes the light that comes out of matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Integrator {
    /// Probes of each pixel, whose hits are lit: unbiased.
    #[default]
    Sample = shared::INTEGRATOR_SAMPLE,
    /// Points on the surface are lit once and each pixel gathers from all of them: without noise but that of the light
    /// at the points, with an error that falls with their distance and with [`Cloud::opening`]: where light is even, less
    /// than 1 % of single points and 2 % of groups by the default opening; where it changes over half a mean free path,
    /// what that blurs. Each sample is a place in the pixel.
    ///
    /// Not for the directional dipole, sets of several materials and media that a texture changes, nor for recordings.
    /// Light enters on the outer side of surfaces alone.
    Cloud = shared::INTEGRATOR_CLOUD,
    /// Points uniform over the area of the surfaces, with the same models, light and boundaries as [`Integrator::Sample`]
    /// and nothing of its sampling: an independent reference, unbiased. In f64 on the host; slow, and noisy where the mean
    /// free path is short beside the body. See [`reference::uniform`](crate::reference::uniform).
    ///
    /// Not for recordings, nor for an error as goal ([`Renderer::render_until`](crate::Renderer::render_until)).
    Area = shared::INTEGRATOR_AREA,
    /// Random walks through the matter itself, which the models approximate; they take no model. In f64 on the host, slow
    /// where matter hardly absorbs. Exact but for delta lights, whose direction where they enter is forgotten; see
    /// [`reference::walk::radiance`](crate::reference::walk::radiance).
    ///
    /// Not for sets of several materials, surfaces with holes and media, alpha or roughness that a texture changes, nor
    /// for what [`Integrator::Area`] is not for.
    Walk = shared::INTEGRATOR_WALK,
}

impl Integrator {
    /// Every integrator, with its name on the command line.
    pub const NAMES: [(Integrator, &str); 4] = [
        (Integrator::Sample, "sample"),
        (Integrator::Cloud, "cloud"),
        (Integrator::Area, "area"),
        (Integrator::Walk, "walk"),
    ];

    /// Whether it computes the light that comes out of matter on the host.
    pub fn is_on_host(self) -> bool {
        matches!(self, Integrator::Area | Integrator::Walk)
    }
}

impl fmt::Display for Integrator {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let (_, name) = Integrator::NAMES.iter().find(|(it, _)| it == self).expect("every integrator has a name");
        out.pad(name)
    }
}

/// How fine [`Integrator::Cloud`] is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cloud {
    /// Most points, on all surfaces together, 1 to [`Cloud::POINTS_MAX`]. Fewer where their spacing is reached.
    pub points: u32,
    /// A group of points counts as one if its radius is less than this share of its distance; 0 to 1. 0 counts each point.
    pub opening: f64,
    /// Distance between points that is fine enough, in mean free paths; positive.
    pub spacing: f64,
    /// Samples that light each point, of [`Settings::directions`] directions and points of emitters each; at least 1.
    /// Delta lights need none.
    pub samples: u32,
}

impl Cloud {
    /// As many as every device's binding holds.
    pub const POINTS_MAX: u32 = 1 << 19;
}

impl Default for Cloud {
    fn default() -> Self {
        Cloud { points: 1 << 15, opening: 0.7, spacing: 0.5, samples: 32 }
    }
}

/// How tabulated profiles are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// Two neighbouring values in one f32: an integer of 12 bits each, and the exponent that they share, so that one load
    /// serves for three. Each is off by at most 1/4095 of the larger, and images by less than 1e-4.
    #[default]
    Packed,
    /// Each value in an f32.
    Full,
}

impl Precision {
    /// Every choice, with its name on the command line.
    pub const NAMES: [(Precision, &str); 2] = [(Precision::Packed, "packed"), (Precision::Full, "full")];

    /// [`Features::cell_vectors`](shared::Features::cell_vectors).
    pub fn cell_vectors(self) -> u32 {
        match self {
            Precision::Packed => 1,
            Precision::Full => 2,
        }
    }
}

impl fmt::Display for Precision {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let (_, name) = Precision::NAMES.iter().find(|(it, _)| it == self).expect("every choice has a name");
        out.pad(name)
    }
}

/// Which constant stands before the product of Fresnel factors and profile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Normalisation {
    /// 1 / (pi (1 - rho_e)): what leaves is what entered times the albedo.
    #[default]
    Energy,
    /// 1 / pi, as in Jensen et al. 2001: darker by exactly 1 - rho_e.
    Jensen2001,
}

/// How light spreads in translucent matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Model {
    /// What the material's file names, else what is recommended for its matter and the picture; see
    /// [`model`](crate::model).
    #[default]
    Auto,
    /// Standard dipole: H. W. Jensen et al., SIGGRAPH 2001.
    Standard,
    /// Better dipole: E. d'Eon 2012.
    Better,
    /// Directional dipole: J. R. Frisvad, T. Hachisuka, T. K. Kjeldsen, ACM TOG 34 (2014). Can give out more light than
    /// it takes in.
    Directional,
    /// Normalised diffusion: P. Christensen, B. Burley 2015.
    Burley,
    /// Profiles tabulated by simulation.
    Table,
    /// The opaque limit: light leaves where it entered. Its total is that of the standard dipole, or of the profile
    /// that would else be recommended where `Auto` finds it enough.
    Lambert,
}

impl Model {
    /// Every model, with its name in files and on the command line.
    pub const NAMES: [(Model, &str); 7] = [
        (Model::Auto, "auto"),
        (Model::Standard, "standard"),
        (Model::Better, "better"),
        (Model::Directional, "directional"),
        (Model::Burley, "burley"),
        (Model::Table, "table"),
        (Model::Lambert, "lambert"),
    ];
}

impl fmt::Display for Model {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let (_, name) = Model::NAMES.iter().find(|(model, _)| model == self).expect("every model has a name");
        out.pad(name)
    }
}

impl FromStr for Model {
    type Err = String;

    /// The model of that name; the error lists those there are.
    fn from_str(text: &str) -> Result<Model, String> {
        let found = Model::NAMES.iter().find(|(_, name)| *name == text);
        let names = Model::NAMES.map(|(_, name)| name).join(", ");
        found.map(|(model, _)| *model).ok_or_else(|| format!("unknown model \"{text}\"; known: {names}"))
    }
}

/// What may be changed about the directional dipole: by the settings, else in the file by `renormalise`, `reciprocal` and
/// `kappa` beside `model`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directional {
    /// Scales each channel so that a plane under diffuse light gives back what it gives with the standard dipole.
    pub renormalise: bool,
    /// Averages it with itself, light and eye exchanged: reciprocal, as the published model is not.
    pub reciprocal: bool,
    /// The real source is at least kappa / (3 sigma_t) from the exit also where the published model puts it there, and
    /// meshes and normal maps show fireflies; 0 is the published model. From 0 to [`Directional::KAPPA_MAX`]; 1 makes the distance continuous.
    pub kappa: f64,
}

impl Directional {
    /// Largest kappa: from there on the real source is nowhere near its depth.
    pub const KAPPA_MAX: f64 = 100.0;
}

impl Default for Directional {
    fn default() -> Self {
        Directional { renormalise: false, reciprocal: false, kappa: 1.0 }
    }
}

/// Whether light that was scattered once is added to a model that leaves it out; see `reference::single`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SingleScattering {
    /// What the material's file says, else where it makes the error of the total smaller; see
    /// [`model::adds_single_scattering`](crate::model::adds_single_scattering).
    #[default]
    Auto,
    /// To the standard and the better dipole: the other models hold it already.
    On,
    Off,
}

impl SingleScattering {
    /// Every choice, with its name in files and on the command line.
    pub const NAMES: [(SingleScattering, &str); 3] =
        [(SingleScattering::Auto, "auto"), (SingleScattering::On, "on"), (SingleScattering::Off, "off")];
}

impl fmt::Display for SingleScattering {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let (_, name) = SingleScattering::NAMES.iter().find(|(it, _)| it == self).expect("every choice has a name");
        out.pad(name)
    }
}

impl FromStr for SingleScattering {
    type Err = String;

    fn from_str(text: &str) -> Result<SingleScattering, String> {
        let found = SingleScattering::NAMES.iter().find(|(_, name)| *name == text);
        found.map(|(choice, _)| *choice).ok_or_else(|| format!("must be auto, on or off, is \"{text}\""))
    }
}

/// Which camera of the scene looks.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub enum CameraChoice {
    /// The first of the file, or one that frames the scene.
    #[default]
    Default,
    /// By position in the file's list of camera nodes.
    Index(usize),
    /// By name of the node or of the camera.
    Name(String),
}

/// Everything about a render that is not the scene. `Settings::default()` is the program's default.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Width and height (pixels); without it 1024x1024, or the camera's aspect ratio at that height.
    pub resolution: Option<(u32, u32)>,
    pub camera: CameraChoice,
    /// Rendered part of the image, `[x0, y0, x1, y1]`, exclusive of x1 and y1 (pixels). Pixels around it whose hits it
    /// [shares](Settings::reuse) are rendered and left out; recordings have no such pixels.
    pub crop: Option<[u32; 4]>,
    /// Incoming environment directions at each position, N >= 1.
    pub directions: u32,
    pub integrator: Integrator,
    /// Of [`Integrator::Cloud`] alone.
    pub cloud: Cloud,
    pub projection: Projection,
    pub reproject: Reproject,
    pub irradiance: Irradiance,
    /// Of [`Irradiance::Cached`] alone.
    pub cache: Cache,
    /// Of tabulated profiles.
    pub precision: Precision,
    pub normalisation: Normalisation,
    /// Profile of every translucent material; `Auto` leaves it to each.
    pub model: Model,
    /// Of every material with the directional dipole; without it what its file says, else the defaults.
    pub directional: Option<Directional>,
    /// Lets the table model follow how thick the body is at each point; without, every body is a half-space to it.
    pub curvature: bool,
    /// Single scattering of every translucent material; `Auto` leaves it to each.
    pub single_scattering: SingleScattering,
    /// Width of the tiles of pixels that share the hits they light, 1 (none), 2, 4 or 8; see
    /// [`reuse`](mod@crate::reference::reuse). Without it 8, and 4 with [`Reproject::Screen`], where noise falls as much as
    /// frames take longer. Noise falls and goes together in neighbouring pixels, so the mean of many
    /// pixels is no better than it was; no expectation changes. Left out where it does not hold: with the
    /// [cloud](Integrator::Cloud), other projections than `Mis`, the directional dipole, sets of several materials and
    /// media that a texture changes.
    pub reuse: Option<u32>,
    /// Key of all random numbers.
    pub seed: u32,
    /// Adds the environment where a camera ray hits nothing.
    pub show_environment: bool,
    /// Keeps the sums of each batch, from which the variance comes; of no use below `shared::BATCHES` samples.
    pub variance: bool,
    /// Keeps also the sums of each batch of reflected light, so that [`Renderer::render_until`] can estimate the error
    /// of all light.
    ///
    /// [`Renderer::render_until`]: crate::Renderer::render_until
    pub estimate_error: bool,
    /// Share of the profile's energy beyond the ball in which probes look for surfaces; 0 has no ball.
    /// `mis` and `normal` miss at most this share of the light. Their other biases are the lift of shadow rays
    /// ([`shared::SHADOW_OFFSET`]) and, for matter that f32 cannot resolve, a mean free path kept within its reach.
    pub radius_tail: f64,
    /// Most pixels that the device holds at a time; an image of more is rendered in bands of rows, with the rows beside
    /// them that [tiles](Settings::reuse) share: of a few rows as many again may come on top. Without it 2^18, or what
    /// the device's bindings and memory allow. The image does not depend on it; with
    /// [`estimate_error`](Settings::estimate_error) its noise does where a band's edge cuts tiles.
    pub band_pixels: Option<u32>,
    /// Makes what [`Renderer::record`](crate::Renderer::record) needs: one band, whatever `band_pixels` says, colours
    /// in a buffer of their own, and the count of samples on the device. The image does not depend on it, but for noise at
    /// the edge of a [crop](Settings::crop).
    pub recording: bool,
    /// Invocations of a workgroup, 1 to 128; the image does not depend on it.
    pub workgroup: u32,
    /// Where the renderer notes what takes how long; without it nothing is timed. Recordings into a caller's command
    /// buffer are the caller's to time ([`Renderer::record_timed`](crate::Renderer::record_timed)).
    pub timeline: Option<Timeline>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            resolution: None,
            camera: CameraChoice::Default,
            crop: None,
            directions: 1,
            integrator: Integrator::Sample,
            cloud: Cloud::default(),
            projection: Projection::Mis,
            reproject: Reproject::Trace,
            irradiance: Irradiance::Direct,
            cache: Cache::default(),
            precision: Precision::Packed,
            normalisation: Normalisation::Energy,
            model: Model::Auto,
            directional: None,
            curvature: true,
            single_scattering: SingleScattering::Auto,
            reuse: None,
            seed: 0,
            show_environment: false,
            variance: true,
            estimate_error: false,
            radius_tail: 1e-6,
            band_pixels: None,
            recording: false,
            workgroup: shared::WORKGROUP,
            timeline: None,
        }
    }
}

impl Settings {
    /// Width of the tiles that share hits, where they do.
    pub(crate) fn tile_width(&self) -> u32 {
        self.reuse.unwrap_or(match self.reproject {
            Reproject::Trace => 8,
            Reproject::Screen => 4,
        })
    }
}
