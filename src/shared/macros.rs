//! How one definition becomes Rust and GLSL.

use glam::{UVec4, Vec2, Vec3, Vec4};

/// A type that has the same bytes in Rust (`repr(C)`) and in GLSL (`scalar` layout).
pub trait Glsl {
    /// The GLSL declaration of a variable of this type.
    fn declare(name: &str) -> String;
}

macro_rules! glsl_types {
    ($($rust:ty => $glsl:literal),* $(,)?) => {$(
        impl Glsl for $rust {
            fn declare(name: &str) -> String {
                format!(concat!($glsl, " {}"), name)
            }
        }
    )*};
}
glsl_types!(f32 => "float", u32 => "uint", Vec2 => "vec2", Vec3 => "vec3", Vec4 => "vec4", UVec4 => "uvec4");

impl<T: Glsl, const N: usize> Glsl for [T; N] {
    fn declare(name: &str) -> String {
        format!("{}[{N}]", T::declare(name))
    }
}

/// Name, byte offset and GLSL text of a struct's members, for the layout test.
pub struct StructLayout {
    pub name: &'static str,
    pub size: usize,
    pub members: &'static [(&'static str, usize)],
}

macro_rules! structs {
    ($($(#[doc = $doc:literal])* struct $name:ident {
        $($(#[doc = $field_doc:literal])* $field:ident: $type:ty,)*
    })*) => {
        $($(#[doc = $doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
        #[repr(C)]
        pub struct $name { $($(#[doc = $field_doc])* pub $field: $type,)* }

        impl Glsl for $name {
            fn declare(name: &str) -> String { format!(concat!(stringify!($name), " {}"), name) }
        })*

        /// Every shared struct, as Rust lays it out.
        pub const STRUCTS: &[StructLayout] = &[$(StructLayout {
            name: stringify!($name),
            size: size_of::<$name>(),
            members: &[$((stringify!($field), std::mem::offset_of!($name, $field)),)*],
        },)*];

        fn glsl_structs(text: &mut String) {
            $($(text.push_str(concat!("//", $doc, "\n"));)*
            text.push_str(concat!("struct ", stringify!($name), " {\n"));
            $($(text.push_str(concat!("    //", $field_doc, "\n"));)*
            text.push_str(&format!("    {};\n", <$type>::declare(stringify!($field))));)*
            text.push_str("};\n\n");)*
        }
    };
}

macro_rules! buffers {
    ($($(#[doc = $doc:literal])* $slot:ident = $binding:literal: $macro:ident [$element:ty] $array:ident;)*) => {
        /// The storage buffers, by binding number in the one descriptor set.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum Slot { $($(#[doc = $doc])* $slot = $binding,)* }

        impl Slot {
            /// Every slot, in order of binding.
            pub const ALL: &'static [Slot] = &[$(Slot::$slot,)*];

            /// The buffer's name, as debuggers and errors show it.
            pub fn name(self) -> &'static str {
                match self { $(Slot::$slot => stringify!($array),)* }
            }

            /// Bytes of one element.
            pub fn stride(self) -> usize {
                match self { $(Slot::$slot => size_of::<$element>(),)* }
            }

            /// What it holds.
            pub fn about(self) -> &'static str {
                match self { $(Slot::$slot => concat!($($doc),*).trim_start(),)* }
            }
        }

        fn glsl_buffers(text: &mut String) {
            $($(text.push_str(concat!("//", $doc, "\n"));)*
            text.push_str(&format!(
                concat!("#define ", stringify!($macro), "(access) layout(set = 0, binding = ",
                    stringify!($binding), ", scalar) access buffer ", stringify!($slot), "Block {{ {}; }}\n"),
                <$element>::declare(concat!(stringify!($array), "[]"))));)*
            text.push('\n');
        }
    };
}

/// A specialization constant as `Features::named` shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NamedFeature {
    pub name: &'static str,
    pub id: u32,
    pub value: u32,
    pub about: &'static str,
}

macro_rules! features {
    ($($(#[doc = $doc:literal])* $field:ident = $id:literal: $constant:ident,)*) => {
        /// What a scene and its settings require of the kernels: the specialization constants.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct Features { $($(#[doc = $doc])* pub $field: u32,)* }

        impl Features {
            /// (constant id, value) of every specialization constant.
            pub fn constants(&self) -> Vec<(u32, u32)> {
                vec![$(($id, self.$field),)*]
            }

            /// What has the value that `value` knows of each constant's id.
            ///
            /// # Errors
            /// The id of which it knows none.
            pub fn with(value: impl Fn(u32) -> Option<u32>) -> Result<Features, u32> {
                Ok(Features { $($field: value($id).ok_or::<u32>($id)?,)* })
            }

            /// Every specialization constant for a reader: its name in GLSL, id and value, and what it is.
            pub fn named(&self) -> Vec<NamedFeature> {
                vec![$(NamedFeature {
                    name: stringify!($constant),
                    id: $id,
                    value: self.$field,
                    about: concat!($($doc),*).trim_start(),
                },)*]
            }
        }

        fn glsl_features(text: &mut String) {
            $($(text.push_str(concat!("//", $doc, "\n"));)*
            text.push_str(concat!("layout(constant_id = ", stringify!($id), ") const uint ",
                stringify!($constant), " = 0;\n"));)*
            text.push('\n');
        }
    };
}

macro_rules! constants {
    ($($(#[doc = $doc:literal])* $name:ident: $type:tt = $value:expr;)*) => {
        $($(#[doc = $doc])* pub const $name: $type = $value;)*

        /// Name and value of every constant.
        pub const CONSTANTS: &[(&str, f64)] = &[$((stringify!($name), $name as f64),)*];

        fn glsl_constants(text: &mut String) {
            $($(text.push_str(concat!("//", $doc, "\n"));)*
            text.push_str(&constants!(@line $type, stringify!($name), $name));)*
            text.push('\n');
        }
    };
    (@line u32, $name:expr, $value:expr) => { format!("const uint {} = {}u;\n", $name, $value) };
    (@line f32, $name:expr, $value:expr) => { format!("const float {} = {:?};\n", $name, $value) };
}
