//! Figures of the literature that an experiment states for comparison.

use crate::{field::Field, figure::Layer, format::number, run::Run};

/// A range of errors that a publication states for an experiment of the same kind.
pub(crate) struct Published {
    /// The publication and the conditions of its experiment.
    source: String,
    field: Field,
    /// The smallest and the largest value (m).
    range: [f64; 2],
}

impl Published {
    /// The figures that the experiment of a run states.
    pub(crate) fn of(run: &Run) -> Vec<Self> {
        let table = run.header().configuration.parse::<toml::Table>().unwrap_or_default();
        let listed = table.get("published").and_then(toml::Value::as_array);
        let read = |of: &toml::Value| {
            let quantity = of.get("quantity")?.as_str()?;
            let range = of.get("range")?.as_array()?;
            let value = |index: usize| range.get(index)?.as_float();
            Some(Self {
                source: of.get("source")?.as_str()?.to_owned(),
                field: *Field::ALL.iter().find(|field| field.name() == quantity)?,
                range: [value(0)?, value(1)?],
            })
        };
        listed.into_iter().flatten().filter_map(read).collect()
    }

    /// The comparison as a sentence.
    pub(crate) fn sentence(&self) -> String {
        let [low, high] = self.range.map(|m| number(Some(m * 1e3), 0));
        let quantity = match self.field {
            Field::Fit => "a fit RMS",
            Field::Tre => "a TRE",
            _ => "a position error",
        };
        let range =
            if self.range[0] > 0.0 { format!("of {low} to {high} mm") } else { format!("of at most {high} mm") };
        format!("For comparison: {} reports {quantity} {range}.", self.source)
    }

    /// The ranges of a quantity, shaded in a figure in millimetres.
    pub(crate) fn shaded(published: &[Self], field: Field) -> Vec<Layer> {
        let of_field = published.iter().filter(|of| of.field == field && of.range[0] > 0.0);
        of_field
            .map(|of| {
                let [from, to] = of.range.map(|m| m * 1e3);
                Layer::Range { from, to, note: "published".to_owned() }
            })
            .collect()
    }

    /// The sentence on the shaded ranges of a figure of these quantities; empty without any.
    pub(crate) fn caption(published: &[Self], fields: &[Field]) -> &'static str {
        let shown = published.iter().any(|of| fields.contains(&of.field) && of.range[0] > 0.0);
        if shown { " Shaded: the published ranges that the conclusion names." } else { "" }
    }
}
