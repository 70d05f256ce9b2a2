//! Numbers of 32 bits in a file: the least significant byte comes first, on every machine.

use glam::Vec3;

use crate::cluster::Cluster;
use crate::cluster::bounds::Aabb;

/// Bytes of a number.
pub(super) const WORD: usize = size_of::<u32>();

/// Numbers of a cluster.
pub(super) const CLUSTER_WORDS: usize = 18;

/// Appends numbers.
pub(super) fn write(words: impl IntoIterator<Item = u32>, out: &mut Vec<u8>) {
    words.into_iter().for_each(|word| out.extend_from_slice(&word.to_le_bytes()));
}

/// The numbers in some bytes. Bytes that are no whole number at the end are left out.
pub(super) fn read(bytes: &[u8]) -> impl ExactSizeIterator<Item = u32> {
    bytes.chunks_exact(WORD).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
}

/// The first `N` numbers in some bytes, which are at least as many.
#[inline(always)]
pub(super) fn read_array<const N: usize>(bytes: &[u8]) -> [u32; N] {
    let mut words = [0; N];
    words.iter_mut().zip(read(bytes)).for_each(|(word, read)| *word = read);
    words
}

/// The bits of a cluster.
pub(super) fn of_cluster(cluster: &Cluster) -> [u32; CLUSTER_WORDS] {
    let Cluster {
        aabb: Aabb { min, max },
        flux,
        area_flux,
        punctual_flux,
        mean,
        variance,
        axis,
        cos_half_angle,
        range,
    } = *cluster;
    [
        min.x,
        min.y,
        min.z,
        max.x,
        max.y,
        max.z,
        flux,
        area_flux,
        punctual_flux,
        mean.x,
        mean.y,
        mean.z,
        variance,
        axis.x,
        axis.y,
        axis.z,
        cos_half_angle,
        range,
    ]
    .map(f32::to_bits)
}

/// The cluster with these bits.
pub(super) fn to_cluster(words: [u32; CLUSTER_WORDS]) -> Cluster {
    let v = words.map(f32::from_bits);
    let point = |first: usize| Vec3::new(v[first], v[first + 1], v[first + 2]);
    Cluster {
        aabb: Aabb { min: point(0), max: point(3) },
        flux: v[6],
        area_flux: v[7],
        punctual_flux: v[8],
        mean: point(9),
        variance: v[12],
        axis: point(13),
        cos_half_angle: v[16],
        range: v[17],
    }
}
