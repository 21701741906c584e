//! Objects of the charting library: its JSON, by the names of its reference <https://plotly.com/javascript/reference/>.

use serde::Serialize;
use serde_json::{Map, Value};

/// A trace, an axis, a layout or a part of one.
#[derive(Debug, Clone, Default, Serialize)]
#[serde(transparent)]
pub(super) struct Object(Map<String, Value>);

impl Object {
    /// The same with a property. A number that is not finite is null, which the library leaves out.
    pub(super) fn with(mut self, property: &str, value: impl Into<Value>) -> Self {
        self.0.insert(property.to_owned(), value.into());
        self
    }
}

impl From<Object> for Value {
    fn from(object: Object) -> Self {
        Self::Object(object.0)
    }
}

/// A trace of points. Its mode is `lines`, `markers` or `lines+markers`.
pub(super) fn scatter(name: &str, x: Vec<f64>, y: Vec<f64>, mode: &str) -> Object {
    trace("scatter", name, x, y).with("mode", mode)
}

/// A trace of bars.
pub(super) fn bars(name: &str, x: Vec<f64>, y: Vec<f64>) -> Object {
    trace("bar", name, x, y)
}

fn trace(kind: &str, name: &str, x: Vec<f64>, y: Vec<f64>) -> Object {
    Object::default().with("type", kind).with("name", name).with("x", x).with("y", y)
}

/// A line of this width in pixels.
pub(super) fn stroke(colour: &str, width: f64) -> Object {
    Object::default().with("color", colour).with("width", width)
}

/// A marker of this size in pixels.
pub(super) fn marker(colour: &str, size: usize) -> Object {
    Object::default().with("color", colour).with("size", size)
}
