//! Unknowns that a set of measurements brings: a plane a group, an anchor, a scale of a sensor.

/// What an unknown is there for, which decides how it is treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// What was touched or visited, and where things stand: whatever it costs the robot is gauge, so it is
    /// determined before all others and is no answer to what the measurements identify.
    Place,
    /// A property of the instrument, such as its scale: asked about and counted beside the sensor frames.
    Instrument,
}

/// An unknown of a set of measurements, one of each group of its rows; its type is that of its values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unknown {
    /// Its name, by which equations ask for it.
    pub name: &'static str,
    /// What it is there for.
    pub role: Role,
    /// Whether it is held at its value: known.
    pub known: bool,
    /// Whether its rows only compare tools with each other, as visits of one point do: what moves them
    /// alike has no effect on what was measured.
    pub compares: bool,
}

impl Unknown {
    /// A place.
    pub fn place(name: &'static str) -> Self {
        Self {
            name,
            role: Role::Place,
            known: false,
            compares: false,
        }
    }

    /// A property of the instrument.
    pub fn instrument(name: &'static str) -> Self {
        Self {
            role: Role::Instrument,
            ..Self::place(name)
        }
    }

    /// The same, held at its value if it is known.
    #[must_use]
    pub fn known(mut self, known: bool) -> Self {
        self.known = known;
        self
    }

    /// The same, of rows that only compare tools with each other.
    #[must_use]
    pub fn comparing(mut self) -> Self {
        self.compares = true;
        self
    }
}

/// Whose an unknown is.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Key {
    /// A sensor's frame, by name.
    Frame(String),
    /// A tool point or a body on the tool, by robot and name.
    Target(usize, String),
    /// An unknown of a group of a set.
    Own(Own),
}

/// An unknown of a group of a set.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Own {
    /// The set, by name.
    pub set: String,
    /// The group, by name; empty where rows have no groups.
    pub group: String,
    /// Its name in the kind.
    pub name: String,
}

impl Own {
    /// The set, with its group in brackets: `touches[wall]`.
    pub fn title(&self) -> String {
        if self.group.is_empty() {
            self.set.clone()
        } else {
            format!("{}[{}]", self.set, self.group)
        }
    }
}
