#include "readers/object_graph.h"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>

namespace etendue {
namespace {

std::string label(const SceneObject& object) {
    return object.id.empty() ? fmt::format("{} \"{}\"", object.category, object.type) : object.id;
}

/// `unsorted` marks the objects on cycles and their descendants; there is at least one.
[[noreturn]] void fail_cycle(const SceneDescription& scene, const std::vector<bool>& unsorted) {
    // Every unsorted object has an unsorted parent, so walking up ends in a cycle.
    const int n = int(scene.objects.size());
    std::vector<int> parent(n, -1);
    for (int i = 0; i < n; ++i)
        if (unsorted[i])
            for (const auto& child : scene.objects[i].children) parent[child.object] = i;
    int at = int(std::find(unsorted.begin(), unsorted.end(), true) - unsorted.begin());
    std::vector<bool> seen(n);
    for (; !seen[at]; at = parent[at]) seen[at] = true;

    constexpr int kMostListed = 8;
    std::string path = label(scene.objects[at]);
    int listed = 0;
    for (int i = parent[at]; i != at; i = parent[i])
        if (++listed <= kMostListed) path = label(scene.objects[i]) + " > " + path;
    throw SceneError(scene.objects[at].where,
                     fmt::format("an object contains itself: {}{} > {}", label(scene.objects[at]),
                                 listed > kMostListed ? " > ..." : "", path));
}

}  // namespace

void check_object_graph(const SceneDescription& scene, int deepest) {
    // Topological order [Kahn 1962]; recursion could exhaust the stack here.
    const int n = int(scene.objects.size());
    std::vector<int> parents_left(n), depth(n, 1), ready;
    for (const SceneObject& object : scene.objects)
        for (const auto& child : object.children) ++parents_left[child.object];
    for (int i = 0; i < n; ++i)
        if (parents_left[i] == 0) ready.push_back(i);
    std::vector<bool> unsorted(n, true);
    int sorted = 0;
    for (; !ready.empty(); ++sorted) {
        const int at = ready.back();
        ready.pop_back();
        unsorted[at] = false;
        if (depth[at] > deepest)
            throw SceneError(scene.objects[at].where,
                             fmt::format("objects are nested more than {} levels deep", deepest));
        for (const auto& child : scene.objects[at].children) {
            depth[child.object] = std::max(depth[child.object], depth[at] + 1);
            if (--parents_left[child.object] == 0) ready.push_back(child.object);
        }
    }
    if (sorted < n) fail_cycle(scene, unsorted);
}

}  // namespace etendue
