//! Reading the JSON document with the path at hand, so that every error names its element.

use crate::io::DecodeError;
use serde_json::{Map, Value};

/// The error of the element at `path`.
pub(super) fn bad(path: &str, what: impl Into<String>) -> DecodeError {
    DecodeError::Element { element: path.to_string(), what: what.into() }
}

/// A value and where it stands: `meshes[2].primitives[0]`.
#[derive(Clone)]
pub(super) struct At<'a> {
    pub(super) value: &'a Value,
    pub(super) path: String,
}

impl<'a> At<'a> {
    pub(super) fn root(document: &'a Value) -> Self {
        At { value: document, path: String::new() }
    }

    fn below(&self, key: &str, value: &'a Value) -> Self {
        let path = if self.path.is_empty() { key.to_string() } else { format!("{}.{key}", self.path) };
        At { value, path }
    }

    pub(super) fn bad(&self, what: impl Into<String>) -> DecodeError {
        bad(if self.path.is_empty() { "document" } else { &self.path }, what)
    }

    /// A property, if it is there.
    pub(super) fn get(&self, key: &str) -> Option<At<'a>> {
        self.value.get(key).map(|v| self.below(key, v))
    }

    /// A property that must be there.
    pub(super) fn need(&self, key: &str) -> Result<At<'a>, DecodeError> {
        self.get(key).ok_or_else(|| self.bad(format!("has no {key}")))
    }

    /// The elements of an array property; none if it is absent.
    pub(super) fn list(&self, key: &str) -> Result<Vec<At<'a>>, DecodeError> {
        let Some(at) = self.get(key) else { return Ok(Vec::new()) };
        let items = at.value.as_array().ok_or_else(|| at.bad("must be an array"))?;
        Ok(items
            .iter()
            .enumerate()
            .map(|(i, value)| At { value, path: format!("{}[{i}]", at.path) })
            .collect())
    }

    /// The properties of an object property; none if it is absent.
    pub(super) fn entries(&self, key: &str) -> Result<Vec<(&'a str, At<'a>)>, DecodeError> {
        let Some(at) = self.get(key) else { return Ok(Vec::new()) };
        let map = at.object()?;
        Ok(map.iter().map(|(k, v)| (k.as_str(), at.below(k, v))).collect())
    }

    pub(super) fn object(&self) -> Result<&'a Map<String, Value>, DecodeError> {
        self.value.as_object().ok_or_else(|| self.bad("must be an object"))
    }

    pub(super) fn string(&self) -> Result<&'a str, DecodeError> {
        self.value.as_str().ok_or_else(|| self.bad("must be a string"))
    }

    /// A whole number that is not negative; `12.0` passes, as some exporters write it.
    pub(super) fn uint(&self) -> Result<usize, DecodeError> {
        uint(self.value)
            .ok_or_else(|| self.bad(format!("{}: must be a whole number, not negative", brief(self.value))))
    }

    pub(super) fn number(&self) -> Result<f64, DecodeError> {
        let n = self.value.as_f64().filter(|n| n.is_finite());
        n.ok_or_else(|| self.bad(format!("{}: must be a number", brief(self.value))))
    }

    /// A whole-number property, or what stands for it when absent.
    pub(super) fn uint_or(&self, key: &str, default: usize) -> Result<usize, DecodeError> {
        self.get(key).map_or(Ok(default), |v| v.uint())
    }

    /// A number property, or what stands for it when absent.
    pub(super) fn number_or(&self, key: &str, default: f64) -> Result<f64, DecodeError> {
        self.get(key).map_or(Ok(default), |v| v.number())
    }

    /// An array property of exactly `N` numbers.
    pub(super) fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, DecodeError> {
        let Some(at) = self.get(key) else { return Ok(None) };
        let items = self.list(key)?;
        if items.len() != N {
            return Err(at.bad(format!("has {} numbers: must have {N}", items.len())));
        }
        let mut out = [0.0; N];
        for (o, i) in out.iter_mut().zip(items) {
            *o = i.number()?;
        }
        Ok(Some(out))
    }

    /// An index property into an array of `len` elements that are called `what`.
    pub(super) fn index(&self, key: &str, len: usize, what: &str) -> Result<Option<usize>, DecodeError> {
        self.get(key).map(|v| v.as_index(len, what)).transpose()
    }

    /// This value as an index into an array of `len` elements that are called `what`.
    pub(super) fn as_index(&self, len: usize, what: &str) -> Result<usize, DecodeError> {
        let i = self.uint()?;
        if i < len { Ok(i) } else { Err(self.bad(format!("index {i}: there are {len} {what}"))) }
    }

    /// The object of an extension.
    pub(super) fn extension(&self, name: &str) -> Option<At<'a>> {
        self.get("extensions")?.get(name)
    }

    pub(super) fn name(&self) -> Option<String> {
        self.value.get("name").and_then(Value::as_str).map(String::from)
    }
}

/// A whole number that is not negative and fits.
pub(super) fn uint(value: &Value) -> Option<usize> {
    let exact = |f: f64| ((0.0..9e15).contains(&f) && f.fract() == 0.0).then_some(f as u64);
    usize::try_from(value.as_u64().or_else(|| value.as_f64().and_then(exact))?).ok()
}

/// A value for a message.
fn brief(value: &Value) -> String {
    let text = value.to_string();
    if text.chars().count() <= 40 { text } else { text.chars().take(40).chain("...".chars()).collect() }
}

/// The elements of an array property, to change; an empty array is put there if it is absent or something else.
pub(super) fn array_mut<'a>(object: &'a mut Map<String, Value>, key: &str) -> &'a mut Vec<Value> {
    let slot = object.entry(key).or_insert_with(|| Value::Array(Vec::new()));
    if !slot.is_array() {
        *slot = Value::Array(Vec::new());
    }
    match slot {
        Value::Array(a) => a,
        _ => unreachable!("made an array above"),
    }
}

/// The elements of an array property, if it is there.
pub(super) fn array_of<'a>(object: &'a mut Map<String, Value>, key: &str) -> &'a mut [Value] {
    match object.get_mut(key) {
        Some(Value::Array(a)) => a,
        _ => &mut [],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn errors_name_the_path() {
        let document = json!({"meshes": [{"primitives": [{"mode": -1}, {"mode": 4.0}]}]});
        let mesh = &At::root(&document).list("meshes").unwrap()[0];
        let primitives = mesh.list("primitives").unwrap();
        let error = primitives[0].uint_or("mode", 4).unwrap_err().to_string();
        assert_eq!(error, "meshes[0].primitives[0].mode: -1: must be a whole number, not negative");
        assert_eq!(primitives[1].uint_or("mode", 0), Ok(4));
        assert_eq!(
            mesh.need("weights").err().map(|e| e.to_string()).as_deref(),
            Some("meshes[0]: has no weights")
        );
    }

    #[test]
    fn an_index_is_held_to_its_array() {
        let document = json!({"mesh": 7});
        let error = At::root(&document).index("mesh", 3, "meshes").unwrap_err().to_string();
        assert_eq!(error, "mesh: index 7: there are 3 meshes");
    }
}
