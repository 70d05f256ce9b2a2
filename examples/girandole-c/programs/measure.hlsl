// The same as measure in shaders.hpp, as an engine writes it in HLSL. DXC makes DXIL and SPIR-V of it.
#define GIRANDOLE_SPACE space1
#include "girandole.hlsli"

RWStructuredBuffer<float4> engine_out : register(u0, space0);

float4 engine_numbers(uint seed)
{
    float4 u;
    for (int i = 0; i < 4; i++) {
        seed = light_hash(seed);
        u[i] = float(seed >> 8) / 16777216.0;
    }
    return u;
}

[numthreads(64, 1, 1)]
void measure(uint3 id : SV_DispatchThreadID)
{
    const float3 position = float3(2.4 * float(id.y % 4) - 3.6, 0.0, 2.4 * float(id.y / 4) - 3.6);
    const LightShadingPoint ground = light_surface_point(position, float3(0.0, 1.0, 0.0));
    light_mark(ground);
    float2 sums = 0.0;
    [loop] for (uint i = 0; i < 64; i++) {
        const LightSample s = light_sample(ground, engine_numbers((id.y * 128 + id.x) * 64 + i));
        if (s.pmf > 0.0) {
            const float lux = s.radiance.y * s.direction.y / (s.pmf * s.pdf);
            sums += float2(lux, lux * lux);
        }
    }
    engine_out[id.y * 128 + id.x] = float4(sums, 0.0, 0.0);
}
