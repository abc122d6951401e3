//! Figures as values: panels with axes, a raster behind, series before it. What they look like is `plot`'s business.

/// Red, green and blue.
pub type Rgb = [u8; 3];

/// One picture: panels side by side.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Stem of its files.
    pub name: String,
    /// What it shows, and which figure of the paper it stands for.
    pub caption: String,
    /// How many panels stand in a row.
    pub columns: usize,
    /// From the left, row by row.
    pub panels: Vec<Panel>,
}

/// One chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Heading.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// What lies behind the series.
    pub raster: Option<Raster>,
    /// What fills the plotting area where the raster does not.
    pub ground: Option<Raster>,
    /// Whether a unit of x shall be as long as a unit of y.
    pub square: bool,
    /// What is drawn, in this order.
    pub series: Vec<Series>,
}

/// An axis: its label with the unit, its ends, and its ticks if they are not just numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Label with unit.
    pub label: String,
    /// Where it begins.
    pub low: f64,
    /// Where it ends.
    pub high: f64,
    /// Named places; round numbers when empty.
    pub ticks: Vec<(f64, String)>,
}

/// Pixels that fill a rectangle of the axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row from the top.
    pub pixels: Vec<Rgb>,
}

/// Points that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// For the legend; none for no entry.
    pub label: Option<String>,
    /// Its colour.
    pub color: Rgb,
    /// How its points are drawn.
    pub mark: Mark,
    /// Places in the units of the axes.
    pub points: Vec<[f64; 2]>,
    /// For each point the low and the high end of its spread along y; empty for none.
    pub spread: Vec<[f64; 2]>,
}

/// How points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A line through all.
    Line,
    /// A broken line through all.
    Dashed,
    /// A line through all, and a dot at each.
    LineAndDots,
    /// A dot each.
    Dot,
    /// A hollow circle each.
    Circle,
    /// A hollow square each.
    Square,
    /// A cross each.
    Cross,
    /// A bar along x from zero to each, this many hundredths of a row high, with its value behind it.
    Bar(u32),
}

/// Colours that colour-blind people tell apart (Okabe and Ito).
pub const PALETTE: [Rgb; 8] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [86, 180, 233],
    [230, 159, 0],
    [120, 94, 240],
    [60, 60, 60],
];

impl Figure {
    /// A figure of these panels, so many a row.
    #[must_use]
    pub fn new(name: impl Into<String>, caption: impl Into<String>, columns: usize, panels: Vec<Panel>) -> Self {
        Self {
            name: name.into(),
            caption: caption.into(),
            columns: columns.max(1),
            panels,
        }
    }
}

impl Panel {
    /// An empty chart.
    #[must_use]
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            raster: None,
            ground: None,
            square: false,
            series: Vec::new(),
        }
    }

    /// With a raster that fills the axes; a unit of x as long as one of y when `square`.
    #[must_use]
    pub fn with_raster(mut self, raster: Raster, square: bool) -> Self {
        self.raster = Some(raster);
        self.square = square;
        self
    }

    /// With a colour that fills the plotting area where the raster does not.
    #[must_use]
    pub fn on_ground(mut self, color: Rgb) -> Self {
        self.ground = Some(Raster {
            width: 1,
            height: 1,
            pixels: vec![color],
        });
        self
    }

    /// With one more series.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }
}

impl Axis {
    /// An axis with round numbers at its ticks.
    #[must_use]
    pub fn new(label: impl Into<String>, low: f64, high: f64) -> Self {
        Self {
            label: label.into(),
            low,
            high: if high > low { high } else { low + 1.0 },
            ticks: Vec::new(),
        }
    }

    /// An upright axis of named rows, one unit apart, the first on top at 0 and the others below it.
    #[must_use]
    pub fn of_rows(names: &[String]) -> Self {
        let places = (0_u32..).map(|k| -f64::from(k));
        let ticks: Vec<(f64, String)> = places.zip(names.iter().cloned()).collect();
        Self {
            label: String::new(),
            low: ticks.last().map_or(0.0, |(at, _)| *at) - 0.6,
            high: 0.6,
            ticks,
        }
    }
}

impl Series {
    /// A series without spread.
    #[must_use]
    pub fn new(label: impl Into<String>, color: Rgb, mark: Mark, points: Vec<[f64; 2]>) -> Self {
        let label = label.into();
        Self {
            label: (!label.is_empty()).then_some(label),
            color,
            mark,
            points,
            spread: Vec::new(),
        }
    }

    /// With the ends of each point's spread.
    #[must_use]
    pub fn with_spread(mut self, spread: Vec<[f64; 2]>) -> Self {
        self.spread = spread;
        self
    }
}
