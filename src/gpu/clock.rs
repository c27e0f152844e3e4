//! From a queue's timestamps to the host's clock. Plain arithmetic: no Vulkan is called.

/// How a queue counts time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Nanoseconds of one tick: `VkPhysicalDeviceLimits::timestampPeriod`.
    pub period: f64,
    /// Bits that count, 36 to 64: `VkQueueFamilyProperties::timestampValidBits`. The counter wraps beyond them, and
    /// what stands above them means nothing.
    pub bits: u32,
}

/// A moment that both clocks know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// The device's.
    pub ticks: u64,
    /// The host's (ns).
    pub host: f64,
    /// How far the two may be apart (ns).
    pub deviation: f64,
}

impl Clock {
    /// Nanoseconds from one timestamp to another, negative if `to` came first. They are less than half a turn of the
    /// counter apart: 34 seconds for 36 bits of a nanosecond each.
    pub fn between(self, from: u64, to: u64) -> f64 {
        let unused = 64 - self.bits.clamp(1, 64);
        // What the counter lacks is shifted out; coming back, the sign is carried along.
        let ticks = (to.wrapping_sub(from) << unused) as i64 >> unused;
        ticks as f64 * self.period
    }

    /// The host's time (ns) of a timestamp.
    pub fn host(self, anchor: Moment, ticks: u64) -> f64 {
        anchor.host + self.between(anchor.ticks, ticks)
    }

    /// Where `first` to `last`, all that the device did of what was submitted at `submitted` and seen to be done at
    /// `ended` (ns), is on the host's clock: where the moment that both know says, within that bracket; without one in
    /// its middle.
    pub fn place(self, [first, last]: [u64; 2], [submitted, ended]: [f64; 2], common: Option<Moment>) -> Moment {
        let slack = ended - submitted - self.between(first, last);
        let middle = Moment { ticks: first, host: submitted + slack / 2.0, deviation: slack.abs() / 2.0 };
        match common {
            Some(known) if slack >= 0.0 => {
                let host = self.host(known, first).clamp(submitted, submitted + slack);
                Moment { ticks: first, host, deviation: known.deviation.min(slack) }
            }
            _ => middle,
        }
    }
}
