//! What the traffic lights show at each time.

/// Seconds for which an approach is green, then amber, then red together with all others of its
/// crossing.
const PHASES: [f64; 3] = [8.0, 1.5, 1.5];
/// Seconds of the cycle that have passed at time 0. The first picture then shows cars whose light
/// has just turned green.
const ROUND_START: f64 = 18.0;

/// What a traffic light shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Cars stop.
    Red,
    /// Red follows.
    Amber,
    /// Cars go.
    Green,
}

/// The group, 0 to 3, of the light for cars that reach a crossing in direction `heading`. All
/// lights of a group show the same signal. `side` is the number of crossings along each side of the
/// city.
pub fn signal_group(node: u32, side: u32, heading: u32) -> u32 {
    (heading + (node % side) + 2 * (node / side)) % 4
}

/// The signal of a group at a time, in seconds. At each crossing one approach is open at a time, so
/// that turning cars never meet.
pub fn signal(group: u32, time: f64) -> Signal {
    let slot: f64 = PHASES.iter().sum();
    let local = (time + ROUND_START + slot * f64::from(group)).rem_euclid(4.0 * slot);
    match local {
        t if t < PHASES[0] => Signal::Green,
        t if t < PHASES[0] + PHASES[1] => Signal::Amber,
        _ => Signal::Red,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_most_one_approach_of_a_crossing_is_open() {
        for tenth in 0..1000 {
            let open = (0..4).filter(|&group| signal(group, tenth as f64 * 0.1) != Signal::Red).count();
            assert!(open <= 1);
        }
    }
}
