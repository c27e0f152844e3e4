//! Every way in which this library fails. Messages name the file, the item and the problem, or the step.

use std::path::PathBuf;

/// The result of a fallible function of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Why something failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A scene file breaks a rule, or asks for what we cannot do.
    #[error("{}: {item}: {problem}", file.display())]
    Scene { file: PathBuf, item: String, problem: String },

    /// A file could not be read or written.
    #[error("{}: {problem}", file.display())]
    File { file: PathBuf, problem: String },

    /// A setting is out of its range or contradicts the scene.
    #[error("{setting}: {problem}")]
    Setting { setting: String, problem: String },

    /// No Vulkan device fits; each candidate with what it lacks.
    #[error("no Vulkan device can be used: {0}")]
    Device(String),

    /// A Vulkan call failed.
    #[error("Vulkan: {step}: {result}")]
    Vulkan { step: String, result: ash::vk::Result },

    /// Memory could not be had, or is known beforehand not to suffice: the device's, or the host's.
    #[error("memory: {step}: {problem}")]
    Memory { step: String, problem: String },
}

impl Error {
    pub(crate) fn scene(file: impl Into<PathBuf>, item: impl Into<String>, problem: impl Into<String>) -> Error {
        Error::Scene { file: file.into(), item: item.into(), problem: problem.into() }
    }

    pub(crate) fn file(file: impl Into<PathBuf>, problem: impl ToString) -> Error {
        Error::File { file: file.into(), problem: problem.to_string() }
    }

    pub(crate) fn setting(setting: impl Into<String>, problem: impl Into<String>) -> Error {
        Error::Setting { setting: setting.into(), problem: problem.into() }
    }

    /// Whether the device was lost: nothing can be done with it any more, but perhaps with a new one
    /// ([`Renderer::resume`](crate::Renderer::resume)).
    pub fn is_device_lost(&self) -> bool {
        matches!(self, Error::Vulkan { result: ash::vk::Result::ERROR_DEVICE_LOST, .. })
    }

    /// Whether the input or the settings are at fault, not the machine: the program exits with 2.
    pub fn is_input(&self) -> bool {
        matches!(self, Error::Scene { .. } | Error::Setting { .. })
    }
}
