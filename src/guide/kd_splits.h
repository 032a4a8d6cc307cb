#pragma once
// Division of space by planes: the nodes of a k-d tree, whose leaves are numbered by whoever builds it.

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "math/bounds.h"

namespace etendue {

class KdSplits {
public:
    static constexpr uint32_t kRoot = 0;

    /// Divides a node at a plane; returns the part below it. The other one is the next.
    uint32_t divide(uint32_t node, int axis, float at) {
        const auto below = uint32_t(nodes_.size());
        nodes_.resize(below + 2);
        nodes_[node] = {at, below << 2 | uint32_t(axis)};
        return below;
    }
    void set_leaf(uint32_t node, size_t number) {
        nodes_[node] = {0, uint32_t(number) << 2 | kLeaf};
    }
    /// Divides the whole space at the middles of the boxes that hold items, until each has at most `most` of them or all of its
    /// items have one position. Brings the items into the order of the leaves, stable in each; returns where each leaf begins,
    /// and the end. A function of the items and their order.
    template <class Item, class Position>
    std::vector<uint32_t> divide_all(std::span<Item> items, size_t most, const Position& position) {
        std::vector<uint32_t> leaves;
        divide_all(kRoot, items, 0, most, position, leaves);
        leaves.push_back(uint32_t(items.size()));
        return leaves;
    }

    /// Number of the leaf that holds `p`.
    size_t leaf(Vec3 p) const {
        uint32_t i = kRoot;
        while (nodes_[i].axis() != kLeaf)
            i = nodes_[i].child() + (p[int(nodes_[i].axis())] >= nodes_[i].split);
        return nodes_[i].child();
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
    template <class Item, class Position>
    void divide_all(uint32_t node, std::span<Item> items, size_t first, size_t most,
                    const Position& position, std::vector<uint32_t>& leaves) {
        Bounds3 box;
        for (const Item& item : items) box.extend(position(item));
        const Vec3 size = box.hi - box.lo;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        const float at = items.empty() ? 0.0f : box.center()[axis];
        // A plane through coincident items leaves one side empty.
        if (items.size() <= most || !(box.lo[axis] < at)) {
            set_leaf(node, leaves.size());
            leaves.push_back(uint32_t(first));
            return;
        }
        const auto middle =
            std::stable_partition(items.begin(), items.end(),
                                  [&](const Item& item) { return position(item)[axis] < at; });
        const auto in_first = size_t(middle - items.begin());
        const uint32_t below = divide(node, axis, at);
        divide_all(below, items.first(in_first), first, most, position, leaves);
        divide_all(below + 1, items.subspan(in_first), first + in_first, most, position, leaves);
    }

    static constexpr uint32_t kLeaf = 3;
    struct Node {
        float split = 0;
        uint32_t child_and_axis = kLeaf;

        uint32_t axis() const { return child_and_axis & 3; }
        /// The part below the plane, or the number of the leaf.
        uint32_t child() const { return child_and_axis >> 2; }
    };
    std::vector<Node> nodes_ = std::vector<Node>(1);
};

}  // namespace etendue
