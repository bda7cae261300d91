//! A figure as the page shows it: title, how to read it, legend, images.

use serde::Serialize;

/// Width of an image that spans the page on a desk screen, px.
pub(super) const WIDE: f64 = 880.0;
/// Width of the same image drawn anew for a phone, px.
pub(super) const NARROW: f64 = 350.0;
/// Width of an image of which two stand side by side, px.
pub(super) const HALF: f64 = 400.0;

/// One figure. It never scales text to be unreadable: wide images are drawn twice, small ones are stacked.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct Figure {
    /// What it shows.
    pub(super) title: String,
    /// One sentence: how to read it.
    pub(super) read: String,
    /// Legend in drawing order.
    pub(super) legend: Vec<Legend>,
    /// Images in reading order.
    pub(super) images: Vec<Image>,
}

/// One entry of a legend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(super) struct Legend {
    /// `line`, `area` or `dot`.
    pub(super) mark: &'static str,
    /// Style class of the series.
    pub(super) class: &'static str,
    /// What it is.
    pub(super) label: &'static str,
}

/// One image, as finished SVG.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct Image {
    /// What distinguishes it from its neighbours; may be empty.
    pub(super) caption: String,
    /// Drawn for a desk screen.
    pub(super) wide: String,
    /// Drawn for a phone; empty: `wide` serves both.
    pub(super) narrow: String,
    /// `whole` (own line) or `side` (two to a line).
    pub(super) layout: &'static str,
}

impl Image {
    /// An image over the whole width, drawn once for each kind of screen.
    pub(super) fn full(caption: impl Into<String>, draw: impl Fn(f64) -> String) -> Self {
        Self {
            caption: caption.into(),
            wide: draw(WIDE),
            narrow: draw(NARROW),
            layout: "whole",
        }
    }

    /// An image of which two fit on a line.
    pub(super) fn half(caption: impl Into<String>, svg: String) -> Self {
        Self {
            caption: caption.into(),
            wide: svg,
            narrow: String::new(),
            layout: "side",
        }
    }
}

/// Legend entries that several figures share.
pub(super) mod legend {
    use super::Legend;

    pub(in super::super) const MEASURED: Legend = Legend {
        mark: "line",
        class: "m",
        label: "measured",
    };
    pub(in super::super) const NOMINAL: Legend = Legend {
        mark: "line",
        class: "n",
        label: "nominal model",
    };
    pub(in super::super) const CALIBRATED: Legend = Legend {
        mark: "line",
        class: "c",
        label: "calibrated twin",
    };
    pub(in super::super) const BAND: Legend = Legend {
        mark: "area",
        class: "b",
        label: "95 % interval",
    };
    pub(in super::super) const STANDSTILL: Legend = Legend {
        mark: "area",
        class: "still",
        label: "standstill",
    };
    pub(in super::super) const ENLARGED: Legend = Legend {
        mark: "area",
        class: "mark",
        label: "enlarged below",
    };
    pub(in super::super) const BEFORE: Legend = Legend {
        mark: "line",
        class: "ns",
        label: "before (nominal)",
    };
    pub(in super::super) const AFTER: Legend = Legend {
        mark: "line",
        class: "c",
        label: "after (calibrated)",
    };
}
