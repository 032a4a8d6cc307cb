#pragma once
// Types that several parts of the extension module share.

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "description/scene_description.h"
#include "film/film.h"
#include "integrator/integrator.h"
#include "sampler/sampler.h"
#include "scene/scene.h"

namespace etendue::python {

namespace nb = nanobind;

/// A scene, and the description that it was built from.
struct SceneHandle {
    SceneHandle(SceneDescription d, Scene s)
        : description(std::move(d)), scene(std::move(s)), film(scene.film(), scene.filter()) {}

    SceneDescription description;
    Scene scene;
    Film film;  ///< For film points of single paths; never rendered into.
};
using ScenePtr = std::shared_ptr<SceneHandle>;

/// A NumPy array of the vector's elements, `channels` floats each, which owns them: nothing is copied.
using FloatArray = nb::ndarray<nb::numpy, float>;
using ReadOnlyDoubles = nb::ndarray<nb::numpy, const double>;
FloatArray to_array(std::vector<Rgb>&& pixels, int width, int height);
FloatArray to_array(std::vector<float>&& values, int width, int height);
/// A small array with a copy of the values.
FloatArray to_array(Vec3 v);
FloatArray to_array(Rgb c);

/// The pixels of an array of shape (H, W, 3).
using ImageArgument = nb::ndarray<const float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;

/// An integrator by name and parameters, or an object that etendue.Integrator is the base of.
IntegratorSpec to_spec(const Scene& scene, nb::handle integrator);
SamplerKind to_sampler(const std::string& name);

/// Runs tasks on a thread of their own, without the GIL, while the calling thread handles signals and callbacks.
class Background {
public:
    /// Set where the task should end soon: where the user interrupts it, or a callback fails.
    std::atomic<bool> stop{false};
    /// Set with it where the work in flight should be dropped.
    std::atomic<bool> drop{false};
    /// Whether Ctrl-C ended the task.
    bool interrupted = false;

    /// Calls `callback` in the calling thread, with the GIL; the task waits until it is done. Called by the task.
    void call(const std::function<void()>& callback);
    /// Returns when the task has ended, and rethrows its exception. `tick` is called with the GIL every 50 ms. Exceptions of
    /// callbacks and ticks end the task, and go on to the caller.
    void run(const std::function<void()>& task, const std::function<void()>& tick);

private:
    struct State;
    State* state_ = nullptr;
};

void bind_description(nb::module_& m);
void bind_render(nb::module_& m);
void bind_reports(nb::module_& m);
void bind_images(nb::module_& m);
void bind_core(nb::module_& m);

}  // namespace etendue::python
