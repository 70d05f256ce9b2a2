//! Degrees of longitude and latitude to metres: the projection UTM, on the ellipsoid WGS 84.
//!
//! Based on Krüger's series in the form of Kawase, "A General Formula for Calculating Meridian Arc Length and its
//! Application to Coordinate Conversion in the Gauss-Krüger Projection", 2011, to the third order: errors are
//! below a millimetre within 30 degrees of the middle of the zone.

use girandole::glam::{DVec2, dvec2};

/// Equatorial radius of the ellipsoid, metres, and its flattening.
const RADIUS: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// The scale at the middle of a zone.
const SCALE: f64 = 0.9996;
/// Metres east at the middle of a zone, and metres north at the equator of southern zones.
const FALSE_EAST: f64 = 500_000.0;
const FALSE_NORTH: f64 = 10_000_000.0;
/// How far positions may be from the middle of the zone, degrees.
const REACH: f64 = 30.0;

/// A zone of UTM.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Utm {
    /// From 1 to 60.
    zone: u32,
    is_south: bool,
}

impl Utm {
    /// The zone in which longitude and latitude lie.
    pub fn at(degrees: DVec2) -> Self {
        let zone = ((degrees.x + 180.0) / 6.0).floor().clamp(0.0, 59.0) as u32 + 1;
        Self { zone, is_south: degrees.y < 0.0 }
    }

    /// The zone of a SUMO network, from its `projParameter`; `None` if that is another projection.
    pub fn of_network(parameter: &str) -> Option<Self> {
        let value = |key: &str| parameter.split_whitespace().find_map(|part| part.strip_prefix(key));
        let is_wgs84 = |name: &str| ["WGS84", "GRS80"].contains(&name);
        let is_known = value("+proj=") == Some("utm")
            && value("+ellps=").is_none_or(is_wgs84)
            && value("+datum=").is_none_or(is_wgs84)
            && value("+units=").is_none_or(|units| units == "m");
        let zone = value("+zone=")?.parse().ok().filter(|zone| (1..=60).contains(zone))?;
        is_known.then(|| Self { zone, is_south: value("+south").is_some() })
    }

    /// Its number in the EPSG registry: 32601 to 32660, and 32701 to 32760 in the south.
    pub fn epsg(self) -> u32 {
        self.zone + if self.is_south { 32_700 } else { 32_600 }
    }

    /// Metres east and north; an error if the position is too far from the zone.
    pub fn project(self, degrees: DVec2) -> Result<DVec2, String> {
        let east = (degrees.x - (6.0 * f64::from(self.zone) - 183.0) + 180.0).rem_euclid(360.0) - 180.0;
        if east.abs() > REACH {
            return Err(format!("{degrees} is too far from the zone of the network, EPSG:{}", self.epsg()));
        }
        let (longitude, latitude) = (east.to_radians(), degrees.y.to_radians());
        let n = FLATTENING / (2.0 - FLATTENING);
        let alpha = [
            n / 2.0 - 2.0 / 3.0 * n.powi(2) + 5.0 / 16.0 * n.powi(3),
            13.0 / 48.0 * n.powi(2) - 3.0 / 5.0 * n.powi(3),
            61.0 / 240.0 * n.powi(3),
        ];
        let eccentricity = 2.0 * n.sqrt() / (1.0 + n);
        let sin = latitude.sin();
        let t = (sin.atanh() - eccentricity * (eccentricity * sin).atanh()).sinh();
        let (xi, eta) = (t.atan2(longitude.cos()), (longitude.sin() / t.hypot(1.0)).atanh());
        let (mut x, mut y) = (eta, xi);
        for (alpha, twice) in alpha.into_iter().zip([2.0, 4.0, 6.0]) {
            x += alpha * (twice * xi).cos() * (twice * eta).sinh();
            y += alpha * (twice * xi).sin() * (twice * eta).cosh();
        }
        let scale = SCALE * RADIUS / (1.0 + n) * (1.0 + n.powi(2) / 4.0 + n.powi(4) / 64.0);
        Ok(dvec2(FALSE_EAST + scale * x, scale * y + if self.is_south { FALSE_NORTH } else { 0.0 }))
    }
}

/// The zone that `network` states, the `projParameter` of a SUMO network, for positions in degrees, of
/// which `degrees` is one. The error says what to do.
pub fn zone_for(degrees: DVec2, network: Option<&str>) -> Result<Utm, String> {
    let what = "the positions are degrees of longitude and latitude";
    let other = format!("project them to metres, for example to EPSG:{}", Utm::at(degrees).epsg());
    match network {
        Some(parameter) => Utm::of_network(parameter)
            .ok_or_else(|| format!("{what}, and the network's projection {parameter:?} is not UTM on WGS 84; {other}")),
        None => Err(format!("{what}; name the SUMO network of the place with --net FILE.net.xml, or {other}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_in_utm_are_those_that_are_published() {
        // An example of the manual of GeographicLib's GeoConvert.
        let baghdad = dvec2(44.4, 33.3);
        let zone = Utm::of_network("+proj=utm +zone=38 +ellps=WGS84 +datum=WGS84 +units=m +no_defs").unwrap();
        assert_eq!((zone, zone.epsg()), (Utm::at(baghdad), 32_638));
        assert!(zone.project(baghdad).unwrap().distance(dvec2(444_140.54, 3_684_706.36)) < 0.01);
        // The equator at the middle of a zone; a quarter of the meridian is 10,001,965.729 m long.
        let south = Utm::of_network("+proj=utm +zone=31 +south").unwrap();
        assert_eq!(south.project(dvec2(3.0, 0.0)), Ok(dvec2(500_000.0, 10_000_000.0)));
        let pole = Utm::at(dvec2(3.0, 52.0)).project(dvec2(3.0, 90.0)).unwrap();
        assert!(pole.distance(dvec2(500_000.0, 0.9996 * 10_001_965.729)) < 1e-3, "{pole}");
        // Zone 1 begins at the antimeridian. Positions on both sides of its middle mirror each other.
        let zone = Utm::at(dvec2(-179.9, -17.0));
        let [west, east] = [179.9, -173.9].map(|longitude| zone.project(dvec2(longitude, -17.0)).unwrap());
        assert!((west.x + east.x - 1e6).abs() < 1e-6 && (west.y - east.y).abs() < 1e-6, "{west} {east}");
        assert!(south.project(dvec2(34.0, 0.0)).unwrap_err().contains("EPSG:32731"));
    }

    #[test]
    fn other_projections_of_networks_are_refused() {
        let at = dvec2(-88.2, 40.1);
        for parameter in ["!", "-", "+proj=merc", "+proj=utm +zone=61", "+proj=utm +zone=16 +ellps=intl", "+proj=utm"] {
            let message = zone_for(at, Some(parameter)).unwrap_err();
            assert!(message.contains(parameter) && message.contains("EPSG:32616"), "{message}");
        }
        assert!(zone_for(at, None).unwrap_err().contains("--net"));
    }
}
