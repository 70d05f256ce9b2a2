//! The record of a node: its 208 bytes in memory, with the least significant byte of each number
//! first.

use crate::tree::node::Node;

/// Bytes of a record.
pub(super) const NODE_BYTES: usize = size_of::<Node>();

/// Appends the records of some nodes.
pub(super) fn write(nodes: &[Node], out: &mut Vec<u8>) {
    if cfg!(target_endian = "little") {
        out.extend_from_slice(bytemuck::cast_slice(nodes));
    } else {
        nodes.iter().for_each(|node| out.extend_from_slice(bytemuck::bytes_of(&reversed(node))));
    }
}

/// The node in the bytes of a record.
#[inline(always)]
pub(super) fn read(bytes: &[u8]) -> Node {
    let node: Node = bytemuck::pod_read_unaligned(bytes);
    if cfg!(target_endian = "little") { node } else { reversed(&node) }
}

/// The node with the bytes of each number in reverse order.
fn reversed(node: &Node) -> Node {
    Node {
        origin: node.origin.map(|v| f32::from_bits(v.to_bits().swap_bytes())),
        steps: node.steps.swap_bytes(),
        children: node.children.map(u32::swap_bytes),
        flux: node.flux.map(u16::swap_bytes),
        parent: node.parent.swap_bytes(),
        area_ratios: node.area_ratios.swap_bytes(),
        range: node.range.map(u16::swap_bytes),
        ..*node
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The widths of the numbers in a node, in the order of its bytes.
    fn widths() -> impl Iterator<Item = usize> {
        [(3 + 1 + 8, 4), (8, 2), (10 * 8, 1), (2, 4), (5 * 8, 1), (8, 2)]
            .into_iter()
            .flat_map(|(count, width)| std::iter::repeat_n(width, count))
    }

    #[test]
    fn a_machine_of_the_other_byte_order_reverses_each_number_of_a_node_and_nothing_else() {
        let bytes: Vec<u8> = (0..NODE_BYTES).map(|byte| byte as u8).collect();
        let node: Node = bytemuck::pod_read_unaligned(&bytes);
        let mut expected = bytes.clone();
        let mut rest = &mut expected[..];
        for width in widths() {
            let (number, others) = rest.split_at_mut(width);
            number.reverse();
            rest = others;
        }
        assert!(rest.is_empty());
        assert_eq!(bytemuck::bytes_of(&reversed(&node)), expected);
        assert_eq!(bytemuck::bytes_of(&reversed(&reversed(&node))), bytes);
    }

    #[test]
    fn a_record_has_the_bytes_of_the_node_with_the_least_significant_byte_first() {
        let node = Node { parent: 0x0403_0201, ..Node::EMPTY };
        let mut bytes = Vec::new();
        write(&[Node::EMPTY, node], &mut bytes);
        assert_eq!(bytes.len(), 2 * NODE_BYTES);
        assert_eq!(bytes[NODE_BYTES..][144..148], [1, 2, 3, 4]);
        assert_eq!(read(&bytes[NODE_BYTES..]), node);
    }
}
