//! A JSON value that knows its file and its path, so that every error names the item.

use crate::{Error, Result};
use serde_json::Value;
use std::path::Path;

/// Most characters of a name that a path shows.
const NAME_LENGTH: usize = 40;

/// A value of the file with its path, such as `materials[0] (wax).extensions.KHR_materials_ior.ior`.
#[derive(Clone)]
pub(super) struct Item<'a> {
    pub file: &'a Path,
    pub path: String,
    value: &'a Value,
}

impl<'a> Item<'a> {
    pub fn root(file: &'a Path, value: &'a Value) -> Self {
        Item { file, path: String::new(), value }
    }

    /// A thing of a caller's, without JSON, so that messages name it.
    pub fn of_caller(file: &'a Path, path: String) -> Self {
        Item { file, path, value: &Value::Null }
    }

    pub fn error(&self, problem: impl Into<String>) -> Error {
        let path = if self.path.is_empty() { "glTF" } else { &self.path };
        Error::scene(self.file, path, problem)
    }

    /// A sentence about this item, for warnings.
    pub fn note(&self, problem: impl std::fmt::Display) -> String {
        format!("{}: {problem}", self.path)
    }

    fn mistyped(&self, wanted: &str) -> Error {
        let found = match self.value {
            Value::Null => "null".to_string(),
            Value::Bool(value) => value.to_string(),
            Value::Number(value) => value.to_string(),
            Value::String(_) => "a string".to_string(),
            Value::Array(values) => format!("an array of {}", values.len()),
            Value::Object(_) => "an object".to_string(),
        };
        self.error(format!("must be {wanted}, is {found}"))
    }

    /// The member `key` of an object, if it is there.
    pub fn get(&self, key: &str) -> Result<Option<Item<'a>>> {
        let members = self.value.as_object().ok_or_else(|| self.mistyped("an object"))?;
        Ok(members.get(key).map(|value| self.at(if self.path.is_empty() { "" } else { "." }, key, value)))
    }

    /// The member `key` of an object.
    pub fn need(&self, key: &str) -> Result<Item<'a>> {
        self.get(key)?.ok_or_else(|| self.error(format!("has no `{key}`")))
    }

    /// The value at the end of a path of optional objects.
    pub fn find(&self, keys: &[&str]) -> Result<Option<Item<'a>>> {
        let mut item = self.clone();
        for key in keys {
            match item.get(key)? {
                Some(next) => item = next,
                None => return Ok(None),
            }
        }
        Ok(Some(item))
    }

    /// The extension `name` of this item.
    pub fn extension(&self, name: &str) -> Result<Option<Item<'a>>> {
        self.find(&["extensions", name])
    }

    /// The keys of an object, in the map's order.
    pub fn keys(&self) -> Result<Vec<&'a str>> {
        let members = self.value.as_object().ok_or_else(|| self.mistyped("an object"))?;
        Ok(members.keys().map(String::as_str).collect())
    }

    /// The elements of an array.
    pub fn elements(&self) -> Result<Vec<Item<'a>>> {
        let values = self.value.as_array().ok_or_else(|| self.mistyped("an array"))?;
        let element = |(index, value): (usize, &'a Value)| {
            let name = value.get("name").and_then(Value::as_str).unwrap_or("");
            let label = if name.is_empty() { String::new() } else { format!(" ({})", shorten(name)) };
            self.at("", &format!("[{index}]{label}"), value)
        };
        Ok(values.iter().enumerate().map(element).collect())
    }

    /// The elements of the array `key`; none if it is absent.
    pub fn list(&self, key: &str) -> Result<Vec<Item<'a>>> {
        self.get(key)?.map_or(Ok(Vec::new()), |item| item.elements())
    }

    fn at(&self, separator: &str, step: &str, value: &'a Value) -> Item<'a> {
        Item { file: self.file, path: format!("{}{separator}{step}", self.path), value }
    }

    /// A number; JSON holds no NaN or infinity.
    pub fn number(&self) -> Result<f64> {
        self.value.as_f64().filter(|value| value.is_finite()).ok_or_else(|| self.mistyped("a number"))
    }

    /// A number within `[low, high]`.
    pub fn within(&self, low: f64, high: f64) -> Result<f64> {
        let value = self.number()?;
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(self.error(match (low, high) {
            (_, f64::INFINITY) => format!("must be at least {low}, is {value}"),
            _ => format!("must be from {low} to {high}, is {value}"),
        }))
    }

    /// A number above zero.
    pub fn positive(&self) -> Result<f64> {
        let value = self.number()?;
        if value > 0.0 { Ok(value) } else { Err(self.error(format!("must be above 0, is {value}"))) }
    }

    /// A whole number that is not negative.
    pub fn whole(&self) -> Result<usize> {
        let value = self.value.as_u64().and_then(|value| usize::try_from(value).ok());
        value.ok_or_else(|| self.mistyped("a whole number that is not negative"))
    }

    /// An index into a list of `count` things.
    pub fn index(&self, count: usize, list: &str) -> Result<usize> {
        let index = self.whole()?;
        if index < count {
            return Ok(index);
        }
        Err(self.error(format!("is {index}, but `{list}` holds {count}")))
    }

    pub fn string(&self) -> Result<&'a str> {
        self.value.as_str().ok_or_else(|| self.mistyped("a string"))
    }

    pub fn boolean(&self) -> Result<bool> {
        self.value.as_bool().ok_or_else(|| self.mistyped("true or false"))
    }

    /// Exactly `N` numbers.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N]> {
        let elements = self.elements()?;
        if elements.len() != N {
            return Err(self.mistyped(&format!("an array of {N} numbers")));
        }
        let mut numbers = [0.0; N];
        for (number, element) in numbers.iter_mut().zip(&elements) {
            *number = element.number()?;
        }
        Ok(numbers)
    }

    /// Exactly `N` numbers within `[low, high]`.
    pub fn numbers_within<const N: usize>(&self, low: f64, high: f64) -> Result<[f64; N]> {
        let numbers = self.numbers()?;
        for element in self.elements()? {
            element.within(low, high)?;
        }
        Ok(numbers)
    }

    /// Three numbers within `[low, high]`, or one that stands for three equal ones.
    pub fn channels_within(&self, low: f64, high: f64) -> Result<glam::DVec3> {
        if self.value.is_number() {
            return Ok(glam::DVec3::splat(self.within(low, high)?));
        }
        self.numbers_within(low, high).map(glam::DVec3::from_array)
    }

    /// The name of a thing, or none.
    pub fn name(&self) -> Result<Option<String>> {
        let name = self.get("name")?.map(|name| name.string()).transpose()?;
        Ok(name.filter(|name| !name.is_empty()).map(str::to_string))
    }
}

/// A name from a file as a message can show it: one line, not long.
pub(super) fn shorten(name: &str) -> String {
    let shown: String = name.chars().take(NAME_LENGTH).flat_map(char::escape_debug).collect();
    if name.chars().nth(NAME_LENGTH).is_some() { shown + "..." } else { shown }
}
