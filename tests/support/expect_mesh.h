#pragma once

#include <gtest/gtest.h>

#include "description/mesh_data.h"

namespace etendue {

/// Checks the guarantees of every mesh reader.
inline void expect_well_formed(const MeshData& m) {
    EXPECT_FALSE(m.triangles.empty());
    EXPECT_TRUE(m.normals.empty() || m.normals.size() == m.positions.size());
    EXPECT_TRUE(m.uvs.empty() || m.uvs.size() == m.positions.size());
    for (const MeshData::Triangle& t : m.triangles)
        for (const uint32_t v : t) ASSERT_LT(v, m.positions.size());
    for (const Vec3& n : m.normals) ASSERT_NEAR(length(n), 1, 1e-5f);
}

}  // namespace etendue
