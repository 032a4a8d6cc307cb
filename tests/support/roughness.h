#pragma once
// The widths of microfacet distributions that tests of rough materials go through.

namespace etendue::testing {

/// Alpha along the two tangents.
struct Roughness {
    float x, y;
};
inline constexpr Roughness kRoughness[] = {
    {1, 1}, {0.3f, 0.3f}, {0.05f, 0.05f}, {0.001f, 0.001f}, {0.4f, 0.1f}};

}  // namespace etendue::testing
