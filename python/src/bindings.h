#pragma once
// Types that several parts of the extension module share.

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/shared_ptr.h>  // of scenes

#include "description/scene_description.h"
#include "film/film.h"
#include "integrator/integrator.h"
#include "scene/builder.h"
#include "scene/scene.h"

namespace etendue::python {

namespace nb = nanobind;

/// What Python calls a Description, with the parts of the scene that was last built from it or from a copy.
struct Description : SceneDescription {
    Description() = default;
    Description(SceneDescription d) : SceneDescription(std::move(d)) {}

    std::shared_ptr<const BuiltParts> built;
};

/// A scene, and the description that it was built from.
struct SceneHandle : std::enable_shared_from_this<SceneHandle> {
    SceneHandle(Description d, Scene s);
    SceneHandle(const SceneHandle&) = delete;
    SceneHandle& operator=(const SceneHandle&) = delete;
    ~SceneHandle();
    /// The handle of a scene, which keeps it alive.
    static std::shared_ptr<SceneHandle> of(const Scene& scene);

    Description description;
    Scene scene;
    uint64_t fingerprint;  ///< scene_fingerprint(); files may change after the scene was built.
    bool lenient = false, watertight = false;  ///< As it was built.

    /// For film points of single paths; never rendered into. It takes memory from the first call on.
    const Film& film();

private:
    std::once_flag film_made_;
    std::unique_ptr<Film> film_;
};
using ScenePtr = std::shared_ptr<SceneHandle>;

/// Called by everything that uses threads. Raises RuntimeError in a process that was forked from one which had used them,
/// since these threads do not exist in it, and work for them would never be done.
void use_threads();
/// To be called once, when the module is loaded.
void watch_forks();

/// A NumPy array of the vector's elements, `channels` floats each, which owns them: nothing is copied.
using FloatArray = nb::ndarray<nb::numpy, float>;
FloatArray to_array(std::vector<Rgb>&& pixels, int width, int height);
FloatArray to_array(std::vector<float>&& values, int width, int height);
/// A small array with a copy of the values.
FloatArray to_array(Vec3 v);
FloatArray to_array(Rgb c);

/// The pixels of an array of shape (H, W, 3).
using ImageArgument = nb::ndarray<const float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
/// Raises ValueError where there are none, or too many.
std::span<const Rgb> pixels_of(const ImageArgument& image);

/// As Technique.strategy names it.
const char* name_of(Strategy strategy);

/// An integrator by name and parameters, as a text or a dict, or an object that etendue.Integrator is the base of.
IntegratorSpec to_spec(const Scene& scene, nb::handle integrator);
/// The object of an integrator in Python, to which all copies of what to_spec() returned refer; nullptr if it is none.
nb::object* python_integrator(const IntegratorSpec& spec);

/// Runs tasks on a thread of their own, without the GIL, while the calling thread handles signals and callbacks.
class Background {
public:
    /// Set where the task should end soon: where the user interrupts it, or a callback fails.
    std::atomic<bool> stop{false};
    /// Set with it where the work in flight should be dropped.
    std::atomic<bool> drop{false};
    /// Whether Ctrl-C ended the task.
    bool interrupted = false;
    /// Whether run() throws an exception of the task, and not one of callbacks, ticks or signal handlers.
    bool task_failed = false;

    /// Calls `callback` in the calling thread, with the GIL; the task waits until it is done. Called by the task.
    void call(const std::function<void()>& callback);
    /// Returns when the task has ended, and rethrows its exception. `tick` is called with the GIL every 50 ms. Exceptions of
    /// callbacks and ticks end the task, and go on to the caller.
    void run(const std::function<void()>& task, const std::function<void()>& tick);

    /// Calls `call`, which calls objects of Python for the task, with the GIL. What they raise that is no Exception, such as
    /// SystemExit, ends the task of this thread, and goes on to the caller even where the task would survive it.
    template <class Call>
    static auto calling_objects(const Call& call) {
        try {
            return call();
        } catch (const nb::python_error& e) {
            if (!e.matches(PyExc_Exception)) end_task();
            throw;
        }
    }

private:
    /// With the exception that is being handled, if this thread runs a task.
    static void end_task();

    struct State;
    State* state_ = nullptr;
};

/// Names of files may hold any bytes; those that are not UTF-8 are replaced.
template <class Json>
std::string json_text(const Json& json) {
    return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

void bind_memory(nb::module_& m);
void bind_description(nb::module_& m);
void bind_render(nb::module_& m);
void bind_reports(nb::module_& m);
void bind_images(nb::module_& m);
void bind_rays(nb::module_& m);
void bind_scattering(nb::module_& m);
void bind_techniques(nb::module_& m);
void bind_sub_paths(nb::module_& m);
void bind_integrators(nb::module_& m);
void bind_path_records(nb::module_& m);

}  // namespace etendue::python
