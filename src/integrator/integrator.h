#pragma once
// Integrators: which sub-paths are traced, which techniques join them, how many samples each takes. Nothing else.

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "description/params.h"
#include "pathspace/join.h"
#include "pathspace/sink.h"

namespace etendue {

/// Statistical nature of an estimator; written into reports and images.
enum class Estimator { Unbiased, Consistent, Biased };

/// Buffers of one worker, reused from sample to sample.
struct Workspace {
    SubPath y, z;
    SubPath pair;  ///< The other path of a pair of vertices.
    Vertex scratch;
    std::vector<float> masses;  ///< Of light vertices, seen from one eye vertex.
    bool is_observed = false;   ///< Whole sub-paths are read, not only what joins need of them.
    RenderStats stats;
};

/// One sample: the eye path of a pixel, the light path of the same index, or both.
struct SampleContext {
    const Scene& scene;
    const Film& film;
    uint64_t pixel;        ///< Index within the crop; also that of the light path.
    uint64_t chunk;        ///< Part of the pass; its samples are taken in order by one thread.
    uint64_t light_paths;  ///< N_L of the pass.
    float splat_scale;     ///< 1 / N_L: what a splat is worth on the film.
    Sampler& sampler;
    ContributionSink& sink;

    /// The same sample with other numbers, and contributions to `to`.
    SampleContext with(Sampler& numbers, ContributionSink& to) const {
        return {scene, film, pixel, chunk, light_paths, splat_scale, numbers, to};
    }
};

/// What is known before a pass: the scene and what the finished passes left.
struct LearnContext {
    const Scene& scene;
    const Film& film;
    uint32_t index;        ///< Of the pass that will be traced, from 0.
    uint64_t light_paths;  ///< N_L of that pass.
    uint64_t pixels;
    const RenderStats& so_far;  ///< Of all finished passes; the same for any number of threads.
};

/// What an integrator may do before the samples of a pass.
struct PassContext {
    const Scene& scene;
    const Film& film;
    uint32_t index;        ///< Of the pass, from 0.
    uint64_t light_paths;  ///< N_L.
    uint64_t pixels;
    const RenderStats& so_far;  ///< Of all earlier passes; the same for any number of threads.
    /// Calls `use(context, work)` for the samples 0 … count-1 in parallel. Only splats may be added.
    using Use = std::function<void(const SampleContext&, Workspace&)>;
    std::function<void(uint64_t count, const Use& use)> for_each_sample;
    std::function<uint64_t(uint64_t count)> chunks;  ///< That so many samples are cut into.
    /// Calls `task(i, sampler, work)` for i < count in parallel: paths that bring nothing to the film. The task starts the
    /// sampler; paths from the number of pixels on have numbers of their own.
    using Task = std::function<void(uint64_t, Sampler&, Workspace&)>;
    std::function<void(uint64_t count, const Task& task)> for_each_other_path;

    void for_each_light_path(const Use& use) const { for_each_sample(light_paths, use); }
};

class Integrator {
public:
    virtual ~Integrator() = default;
    /// Takes over what finished passes tell. Called by one thread, once for each pass, before its begin_pass(): a pass that
    /// was dropped and is traced again is begun twice, but learned for once.
    virtual void learn(const LearnContext&) {}
    /// Called by one thread before the samples of each pass. What it throws, and what samples throw, drops the pass.
    virtual void begin_pass(const PassContext&) {}
    /// Traces sample `context.pixel` and reports its contributions.
    virtual void sample(const SampleContext& context, Workspace& work) const = 0;
    /// Samples of each strategy per eye sub-path, as the weights have it, where a pass traces `light_paths`.
    virtual TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const = 0;
    /// Light paths per pixel in one pass: 0 or 1.
    virtual bool traces_light_paths() const = 0;
    /// Light paths of one pass over a film of so many pixels.
    virtual uint64_t light_paths(uint64_t pixels) const {
        return traces_light_paths() ? pixels : 0;
    }
    /// Whether contributions come with the sub-paths they were made of, so that `verify` can tell their paths.
    virtual bool keeps_paths() const { return true; }
    virtual Estimator estimator() const = 0;
    /// What a run tells of the integrator's own structures, by name; as of the last pass.
    virtual std::vector<std::pair<std::string, double>> figures() const { return {}; }
};

/// The text after an integrator's name: `bdpt:max_depth=12,rr_depth=5`. Checked against the integrator's table.
struct IntegratorSpec {
    std::string name;
    std::map<std::string, std::string> params;

    /// Throws std::runtime_error with one clear message.
    static IntegratorSpec parse(const std::string& text);
    std::string to_string() const;
};

/// One of the words that a parameter may be, and what it stands for.
template <class T>
struct Choice {
    const char* name;
    T value;
};

/// Typed access to a spec's parameters; the table's defaults where absent.
class IntegratorParams {
public:
    IntegratorParams(const IntegratorSpec& spec, const PluginInfo& info);
    int integer(const char* name) const;
    float number(const char* name) const;
    bool flag(const char* name) const;
    template <class T, size_t N>
    T choice(const char* name, const std::array<Choice<T>, N>& choices) const {
        std::vector<std::string> known;
        for (const Choice<T>& c : choices) {
            if (text(name) == c.name) return c.value;
            known.push_back(c.name);
        }
        refuse_choice(name, known);
    }
    /// As integer() and number(), within [low, high].
    int integer(const char* name, int low, int high) const;
    float number(const char* name, float low, float high) const;
    const std::string& integrator() const { return integrator_; }

private:
    [[noreturn]] void refuse_choice(const char* name, const std::vector<std::string>& known) const;
    const std::string& text(const char* name) const;
    std::map<std::string, std::string> values_;
    std::string integrator_;
};

struct IntegratorEntry {
    PluginInfo info;
    std::unique_ptr<Integrator> (*make)(const IntegratorParams& params);
};
const std::vector<IntegratorEntry>& integrator_registry();
std::unique_ptr<Integrator> make_integrator(const IntegratorSpec& spec);

/// Longest path and start of roulette, as all integrators have them.
struct DepthOptions {
    int max_depth;  ///< Edges of the longest path; INT_MAX where unlimited.
    int rr_depth;

    static DepthOptions from(const IntegratorParams& params);
    /// Vertices of a sub-path that can still be joined.
    WalkOptions walk() const {
        return {max_depth == kUnlimited ? kUnlimited : max_depth + 1, rr_depth};
    }
    static constexpr int kUnlimited = 1 << 20;
};
std::vector<ParamInfo> depth_params();

}  // namespace etendue
