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

/// Groups of shapes are made once; everything else is visited once for each path that leads to it.
bool is_made_once(const SceneObject& object) {
    return object.type == "shapegroup";
}

/// Objects that name another one several times, again and again, take exponential time to visit. `order`: parents
/// before their children.
void check_size(const SceneDescription& scene, const std::vector<int>& order) {
    constexpr uint64_t kMostVisits = 100'000;
    const uint64_t most = kMostVisits + scene.objects.size();
    std::vector<uint64_t> visits(scene.objects.size(), 1);  // of an object and what it contains
    for (size_t i = order.size(); i-- > 0;) {
        const SceneObject& object = scene.objects[size_t(order[i])];
        uint64_t& sum = visits[size_t(order[i])];
        for (const auto& child : object.children)
            sum += is_made_once(scene.objects[size_t(child.object)]) ? 1
                                                                     : visits[size_t(child.object)];
        if (sum > most)
            throw SceneError(
                object.where,
                fmt::format("{} contains more than {} objects, since those in it name the same "
                            "ones several times: name each once",
                            label(object), most));
    }
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
    std::vector<int> order;
    while (!ready.empty()) {
        const int at = ready.back();
        ready.pop_back();
        order.push_back(at);
        unsorted[at] = false;
        if (depth[at] > deepest)
            throw SceneError(scene.objects[at].where,
                             fmt::format("objects are nested more than {} levels deep", deepest));
        for (const auto& child : scene.objects[at].children) {
            depth[child.object] = std::max(depth[child.object], depth[at] + 1);
            if (--parents_left[child.object] == 0) ready.push_back(child.object);
        }
    }
    if (int(order.size()) < n) fail_cycle(scene, unsorted);
    check_size(scene, order);
}

}  // namespace etendue
