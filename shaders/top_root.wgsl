// Top level, the last stage: packs the nodes of the upper part, the deepest first. One workgroup;
// its barriers keep the order. Twin of `TopLevel::add_part`.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(3) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(6) var<storage, read_write> units: array<u32>;

var<workgroup> root_deepest: atomic<u32>;
var<workgroup> root_depth: u32;

@compute @workgroup_size(TOP_LANES)
fn top_root(@builtin(local_invocation_index) lane: u32) {
    if lane == 0u {
        atomicStore(&root_deepest, 0u);
    }
    workgroupBarrier();
    for (var part = lane; part < TOP_ROOT_PARTS; part += TOP_LANES) {
        atomicMax(&root_deepest, units[top_pass.units_after + part]);
    }
    workgroupBarrier();
    if lane == 0u {
        root_depth = atomicLoad(&root_deepest);
    }
    for (var depth = workgroupUniformLoad(&root_depth); depth > 0u; depth--) {
        for (var part = lane; part < TOP_ROOT_PARTS; part += TOP_LANES) {
            if units[top_pass.units_after + part] == depth {
                node_pack(part);
            }
        }
        storageBarrier();
    }
}
