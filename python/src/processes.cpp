// What outlives single calls: scenes by address, and the threads of forked processes.

#include <pthread.h>

#include <map>
#include <mutex>
#include <stdexcept>

#include <nanobind/stl/string.h>

#include "bindings.h"
#include "description/fingerprint.h"
#include "system/memory_limit.h"

namespace etendue::python {
namespace {

std::mutex scenes_mutex;
std::map<const Scene*, SceneHandle*> scenes;

std::atomic<bool> has_used_threads{false}, has_lost_threads{false};

}  // namespace

SceneHandle::SceneHandle(Description d, Scene s)
    : description(std::move(d)), scene(std::move(s)), fingerprint(scene_fingerprint(description)) {
    const std::scoped_lock lock(scenes_mutex);
    scenes.emplace(&scene, this);
}

SceneHandle::~SceneHandle() {
    const std::scoped_lock lock(scenes_mutex);
    scenes.erase(&scene);
}

const Film& SceneHandle::film() {
    std::call_once(film_made_,
                   [&] { film_ = std::make_unique<Film>(scene.film(), scene.filter()); });
    return *film_;
}

ScenePtr SceneHandle::of(const Scene& scene) {
    const std::scoped_lock lock(scenes_mutex);
    return scenes.at(&scene)->shared_from_this();
}

void use_threads() {
    if (has_lost_threads)
        throw std::runtime_error(
            "this process was forked from one that had already built or rendered a scene; its "
            "threads do not exist here. Use the start method \"spawn\" or \"forkserver\": "
            "multiprocessing.get_context(\"spawn\")");
    has_used_threads = true;
}

void bind_memory(nb::module_& m) {
    using namespace nb::literals;
    m.def(
        "limit_memory",
        [](const std::string& size) {
            uint64_t bytes = 0;
            try {
                bytes = parse_memory_size(size, "size");
            } catch (const std::runtime_error& e) {
                throw nb::value_error(e.what());
            }
            limit_memory(bytes);
        },
        "size"_a);
    m.def("unlimit_memory", &unlimit_memory);
}

void watch_forks() {
    pthread_atfork(nullptr, nullptr, [] {
        if (has_used_threads) has_lost_threads = true;
    });
}

}  // namespace etendue::python
