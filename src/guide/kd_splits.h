#pragma once
// Division of space by planes: the nodes of a k-d tree, whose leaves are numbered by whoever builds it.

#include <cstdint>
#include <vector>

#include "math/vec.h"

namespace etendue {

class KdSplits {
public:
    static constexpr uint32_t kRoot = 0;

    /// Divides a node at a plane; returns the part below it. The other one is the next.
    uint32_t divide(uint32_t node, int axis, float at) {
        const auto below = uint32_t(nodes_.size());
        nodes_.resize(below + 2);
        nodes_[node] = {at, uint32_t(axis) & 3, below & 0x3fffffffu};
        return below;
    }
    void set_leaf(uint32_t node, size_t number) {
        nodes_[node] = {0, kLeaf, uint32_t(number) & 0x3fffffffu};
    }
    /// Number of the leaf that holds `p`.
    size_t leaf(Vec3 p) const {
        uint32_t i = kRoot;
        while (nodes_[i].axis != kLeaf)
            i = nodes_[i].child + (p[int(nodes_[i].axis)] >= nodes_[i].split);
        return nodes_[i].child;
    }

    size_t memory_bytes() const { return nodes_.capacity() * sizeof(Node); }
    template <class State>
    void save(State& to) const {
        to.put(nodes_);
    }
    template <class State>
    void load(State& from) {
        from.get(nodes_);
    }

private:
    static constexpr uint32_t kLeaf = 3;
    struct Node {
        float split = 0;
        uint32_t axis : 2 = kLeaf;
        uint32_t child : 30 = 0;  ///< The part below the plane, or the number of the leaf.
    };
    std::vector<Node> nodes_ = std::vector<Node>(1);
};

}  // namespace etendue
