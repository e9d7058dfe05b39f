//! What lies between the torque at the shaft and the logged torque: a delay, a low-pass, a sign, shares of other channels.
//!
//! ```text
//! logged = sign * low-pass(shaft, late by a delay) + sum of gain * (channel - mean)
//! ```
//!
//! A diagnosis finds it on one log of a rig, and it holds for the next log of the same rig. So it is written to `params.toml`, and
//! `predict` applies it. It says nothing of the joint: a driver and an export ignore it.

use crate::linear::motion::{Motion, long};
use crate::parameter_file_error::{ParameterFileErrorKind as Kind, number};
use crate::torque_low_pass::{LowPassShape, TorqueLowPass};
use crate::track::Track;
use joint_log::Dataset;
use std::f64::consts::TAU;
use std::fmt::Write;
use toml_edit::{Item, Table, TableLike};

/// A share of another channel in the logged torque, whichever way the joint moves.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelGain {
    /// The channel's column.
    pub column: String,
    /// Torque per unit of the column.
    pub gain: f64,
    /// Mean of the column, at which the share is taken as 0: a constant torque belongs to the model.
    pub mean: f64,
}

/// How a log's torque column comes from the torque at the shaft.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// Time by which the logged torque is late, s; negative if it is early, as beside a velocity that is late.
    pub torque_delay_s: f64,
    /// Low-pass that it passed.
    pub torque_low_pass: TorqueLowPass,
    /// 1, or -1 for a torque that is logged with the other sign.
    pub torque_sign: f64,
    /// True if the model was fitted to the motion as logged, false for the reconstructed motion.
    pub is_motion_logged: bool,
    /// Shares of other channels.
    pub channel_gains: Vec<ChannelGain>,
}

impl Default for Measurement {
    fn default() -> Self {
        Self {
            torque_delay_s: 0.0,
            torque_low_pass: TorqueLowPass::default(),
            torque_sign: 1.0,
            is_motion_logged: false,
            channel_gains: Vec::new(),
        }
    }
}

/// Keys of the section, in order.
const KEYS: [&str; 7] = [
    "torque_delay_s",
    "torque_lowpass_hz",
    "torque_lowpass_shape",
    "torque_sign",
    "motion",
    "channel_gains",
    "channel_means",
];

impl Measurement {
    /// Returns a measurement with nothing but a sign.
    pub fn of_sign(is_reversed: bool) -> Self {
        Self { torque_sign: if is_reversed { -1.0 } else { 1.0 }, ..Self::default() }
    }

    /// Returns true if the logged torque is that at the shaft.
    pub fn is_exact(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the logged torque in all rows of a log from that at the shaft.
    pub fn logged(&self, data: &Dataset, motion: &Motion, shaft: &[f64]) -> Vec<f64> {
        let mut torque = motion.as_logged(shaft, self.torque_delay_s, self.torque_low_pass);
        torque.iter_mut().for_each(|torque| *torque *= self.torque_sign);
        for (torque, share) in torque.iter_mut().zip(self.shares(data)) {
            *torque += share;
        }
        torque
    }

    /// Returns the channels of which the torque has a share and that a log lacks.
    pub fn missing_columns<'a>(&'a self, data: &'a Dataset) -> impl Iterator<Item = &'a str> {
        let columns = self.channel_gains.iter().map(|share| share.column.as_str());
        columns.filter(|name| long(data, name).is_none())
    }

    /// Returns the shares of other channels in all rows. A channel that the log lacks has none.
    fn shares(&self, data: &Dataset) -> Vec<f64> {
        let mut shares = vec![0.0; data.runs.iter().map(|run| run.len()).sum()];
        for ChannelGain { column, gain, mean } in &self.channel_gains {
            for (share, value) in shares.iter_mut().zip(long(data, column).unwrap_or_default()) {
                *share += gain * (value - mean);
            }
        }
        shares
    }

    /// Returns the shares of other channels along a track.
    pub(crate) fn shares_along(&self, data: &Dataset, track: &Track) -> Vec<f64> {
        let mut shares = vec![0.0; track.len()];
        for ChannelGain { column, gain, mean } in &self.channel_gains {
            let values = data.column(&data.runs[track.run], column).unwrap_or_default();
            for (share, value) in shares.iter_mut().zip(values.iter().skip(track.first_row)) {
                *share += gain * (value - mean);
            }
        }
        shares
    }

    /// Returns a track whose torque is that at the shaft, through the low-pass, and whose velocity has the time of the torque.
    pub(crate) fn shaft_track(&self, data: &Dataset, track: &Track) -> Track {
        let mut shaft = track.clone();
        let shares = self.shares_along(data, track);
        for (torque, share) in shaft.torque.iter_mut().zip(shares) {
            *torque = self.torque_sign * (*torque - share);
        }
        shaft.torque_low_pass = self.torque_low_pass;
        if self.torque_delay_s != 0.0 {
            shaft.shift_velocity(-self.torque_delay_s);
        }
        shaft
    }

    /// The section of a parameter file for what `predict` computes.
    pub const OF_FILE: &'static str = "measurement";

    /// The section for the driver's law, where that was fitted beside another measurement than the file's linear model.
    pub const OF_DRIVER: &'static str = "driver_measurement";

    /// Appends a section of a parameter file.
    pub fn emit(&self, section: &str, text: &mut String) {
        // Writing to a string does not fail.
        let _ = writeln!(text, "\n[{section}]");
        let _ = writeln!(text, "torque_delay_s = {:?}", self.torque_delay_s);
        if self.torque_low_pass.time_s > 0.0 {
            let hz = 1.0 / (TAU * self.torque_low_pass.time_s);
            let shape = self.torque_low_pass.shape.name();
            let _ = write!(text, "torque_lowpass_hz = {hz:?}\ntorque_lowpass_shape = {shape:?}\n");
        }
        let _ = writeln!(text, "torque_sign = {}", self.torque_sign);
        if self.is_motion_logged {
            text.push_str("motion = \"logged\"\n");
        }
        let table = |of: &dyn Fn(&ChannelGain) -> f64| {
            let entries = self
                .channel_gains
                .iter()
                .map(|share| format!("{:?} = {:?}", share.column, of(share)));
            entries.collect::<Vec<_>>().join(", ")
        };
        if !self.channel_gains.is_empty() {
            let _ = writeln!(text, "channel_gains = {{ {} }}", table(&|share| share.gain));
            let _ = writeln!(text, "channel_means = {{ {} }}", table(&|share| share.mean));
        }
    }

    /// Parses the section of a parameter file.
    ///
    /// # Errors
    /// One line that names the key, what was found and what was expected.
    pub(crate) fn parse(root: &Table, section: &str) -> Result<Option<Self>, Kind> {
        let Some(item) = root.get(section) else { return Ok(None) };
        let table = item.as_table_like().ok_or_else(|| Kind::value(section, "a table"))?;
        Self::of_table(table, section).map(Some)
    }

    fn of_table(table: &dyn TableLike, section: &str) -> Result<Self, Kind> {
        let full = |key: &str| format!("{section}.{key}");
        if let Some((key, _)) = table.iter().find(|(key, _)| !KEYS.contains(key)) {
            return Err(Kind::unknown(full(key), KEYS.join(", ")));
        }
        let number = |key: &str| match table.get(key) {
            None => Ok(None),
            Some(item) => finite(item, || full(key)).map(Some),
        };
        let torque_delay_s = number("torque_delay_s")?.unwrap_or_default();
        let mut torque_low_pass = TorqueLowPass::default();
        if let Some(hz) = number("torque_lowpass_hz")? {
            if hz <= 0.0 {
                return Err(Kind::found(full("torque_lowpass_hz"), hz, "more than 0"));
            }
            torque_low_pass.time_s = 1.0 / (TAU * hz);
        }
        if let Some(item) = table.get("torque_lowpass_shape") {
            if torque_low_pass.time_s == 0.0 {
                return Err(Kind::value(full("torque_lowpass_hz"), "a finite number"));
            }
            let shape = item.as_str().and_then(LowPassShape::parse);
            torque_low_pass.shape = shape.ok_or_else(|| {
                let known = LowPassShape::ALL.map(LowPassShape::name).join(", ");
                Kind::found(full("torque_lowpass_shape"), item, format!("of {known}"))
            })?;
        }
        let torque_sign = match number("torque_sign")? {
            None => 1.0,
            Some(sign) if sign.abs() == 1.0 => sign,
            Some(found) => return Err(Kind::found(full("torque_sign"), found, "1 or -1")),
        };
        let is_motion_logged = match table.get("motion").map(|item| (item, item.as_str())) {
            None | Some((_, Some("smoothed"))) => false,
            Some((_, Some("logged"))) => true,
            Some((found, _)) => {
                let found = found.to_string();
                return Err(Kind::found(full("motion"), found.trim(), "smoothed or logged"));
            }
        };
        Ok(Self {
            torque_delay_s,
            torque_low_pass,
            torque_sign,
            is_motion_logged,
            channel_gains: channel_gains(table, section)?,
        })
    }
}

/// Parses the shares of other channels. Each channel has a gain and a mean.
fn channel_gains(table: &dyn TableLike, section: &str) -> Result<Vec<ChannelGain>, Kind> {
    let tables = ["channel_gains", "channel_means"].map(|key| {
        let Some(item) = table.get(key) else { return Ok(None) };
        item.as_table_like()
            .map(Some)
            .ok_or_else(|| Kind::value(format!("{section}.{key}"), "a table"))
    });
    let [gains, means] = tables;
    let (gains, means) = (gains?, means?);
    let number = |table: Option<&dyn TableLike>, key: &str, column: &str| {
        let found = table.and_then(|table| table.get(column)).and_then(number);
        found.ok_or_else(|| Kind::value(format!("{section}.{key}.{column}"), "a finite number"))
    };
    let mut shares: Vec<ChannelGain> = Vec::new();
    for (column, _) in [gains, means].into_iter().flatten().flat_map(TableLike::iter) {
        if shares.iter().all(|share| share.column != column) {
            let gain = number(gains, "channel_gains", column)?;
            let mean = number(means, "channel_means", column)?;
            shares.push(ChannelGain { column: column.to_owned(), gain, mean });
        }
    }
    Ok(shares)
}

/// Returns a finite number. `key` names the value in an error.
fn finite(item: &Item, key: impl Fn() -> String) -> Result<f64, Kind> {
    number(item).ok_or_else(|| Kind::value(key(), "a finite number"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use toml_edit::Document;

    fn parse(text: &str) -> Result<Measurement, Kind> {
        let document = Document::parse(text).expect("a document");
        Measurement::parse(document.as_table(), Measurement::OF_FILE).map(Option::unwrap_or_default)
    }

    #[test]
    fn emit_then_parse_returns_the_measurement() {
        let gain = ChannelGain { column: "pressure_diff_pa".into(), gain: 1e-6, mean: 2e5 };
        let measurement = Measurement {
            torque_delay_s: -0.004,
            torque_low_pass: TorqueLowPass { time_s: 0.25, shape: LowPassShape::RunningMean },
            torque_sign: -1.0,
            is_motion_logged: true,
            channel_gains: vec![gain],
        };
        let mut text = String::new();
        measurement.emit(Measurement::OF_FILE, &mut text);
        let parsed = parse(&text).unwrap();
        assert!((parsed.torque_low_pass.time_s - 0.25).abs() < 1e-12);
        assert_eq!(
            Measurement { torque_low_pass: measurement.torque_low_pass, ..parsed },
            measurement
        );
        assert!(parse("").unwrap().is_exact());
    }

    #[test]
    fn parse_of_impossible_values_names_the_key() {
        for (line, key) in [
            ("torque_sign = 2", "torque_sign"),
            ("torque_lowpass_hz = -1", "torque_lowpass_hz"),
            ("torque_lowpass_hz = 5\ntorque_lowpass_shape = \"box\"", "torque_lowpass_shape"),
            ("torque_lowpass_shape = \"first-order\"", "torque_lowpass_hz"),
            ("torque_delay_ms = 2", "torque_delay_ms"),
            ("motion = \"raw\"", "motion: found \"raw\","),
            ("channel_gains = { a = \"x\" }", "channel_gains.a"),
            ("channel_gains = { a = 1 }", "channel_means.a"),
            ("channel_means = { a = 1 }", "channel_gains.a"),
        ] {
            let error = parse(&format!("[measurement]\n{line}\n")).unwrap_err().to_string();
            assert!(error.contains(&format!("measurement.{key}")), "{error}");
        }
    }
}
