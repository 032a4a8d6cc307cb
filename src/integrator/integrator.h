#pragma once
// Integrators: which sub-paths are traced, which techniques join them, and how many samples each technique takes.

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "description/params.h"
#include "pathspace/learned_state.h"
#include "pathspace/sample_context.h"

namespace etendue {

struct SharedByPilots;

/// Statistical nature of an estimator; written into reports and images.
enum class Estimator { Unbiased, Consistent, Biased };

class Integrator {
public:
    virtual ~Integrator() = default;
    /// Learns from the statistics of earlier passes. Called before pass 0, when there are none, and before passes 1, 4,
    /// 16, 64 …. What is learned holds for a generation of passes, until the next call. From each call on, the random
    /// numbers are independent of all earlier ones. Therefore no pass uses learned data that depend on its own random
    /// numbers, and learning causes no bias. Without error_groups(), the passes of a generation are independent of each
    /// other: what trace() keeps for later ones is a function of the seed. If it throws an exception, it is called again,
    /// and learns the same as if the first call had not been made.
    virtual void learn(const LearnContext&) {}
    /// Traces paths of its own from which it learns. Called after learn(), by one thread. Nothing of this is left if it
    /// throws an exception; then it is called again.
    virtual void prepare(const PassContext&) {}
    /// Whether learn() changes the sampling or the weights of later passes.
    virtual bool is_learning() const { return false; }
    /// Number of the eye paths of a pass. Passes with the same number have the same film points.
    virtual uint32_t eye_paths_of(uint32_t pass) const { return pass; }
    /// Writes the state that later passes need, if there is any. Called between passes. After load(), an integrator with
    /// the same parameters continues as this one would. The state includes neither the film and the statistics nor the
    /// data of a single pass. load() throws std::runtime_error if the state is that of another integrator.
    virtual void save(LearnedState& to) const = 0;
    virtual void load(LearnedState& from) = 0;
    /// Traces the paths that the samples of the pass share. Called by one thread, before the samples. An exception,
    /// here or in a sample, discards the pass. Other processes may make other passes of the generation.
    virtual void trace(const PassContext&) {}

    /// Makes the sums that a worker accumulates during a pass for learn() (Workspace::sums); nullptr if there are none.
    virtual std::unique_ptr<PassSums> make_sums() const { return nullptr; }
    /// Takes the sums of all workers at the end of a pass, which another process may have made. Passes come in order.
    virtual void collect(std::span<const std::unique_ptr<PassSums>>) {}

    /// Traces the eye sub-path z[i] of each sample c[i], at most kWalksInTurn of them, for integrators whose eye paths do
    /// not depend on joins. `stats` receives what is counted.
    virtual void trace_eye_paths(std::span<const SampleContext> /*c*/, std::span<SubPath> /*z*/,
                                 RenderStats& /*stats*/) const {}
    /// Traces sample `context.index` and reports its contributions. `work.z` is what trace_eye_paths() has made of it.
    virtual void sample(const SampleContext& context, Workspace& work) const = 0;
    /// Number of samples of each strategy per eye sub-path, as counted in the weights, for a pass with `light_paths`.
    virtual TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const = 0;
    /// Whether the integrator makes paths by this technique.
    virtual bool uses(const Technique& q, const Scene& scene, uint64_t light_paths) const {
        return counts(scene, light_paths).of(q) > 0;
    }
    /// N_L, the number of light paths in a pass; 0 if there are none.
    virtual uint64_t light_paths(const Scene& scene) const = 0;
    /// Largest memory, in bytes, of the light paths or photons that a pass keeps; 0 if it keeps none.
    virtual uint64_t light_path_memory() const { return 0; }
    /// Whether contributions are reported together with their sub-paths, which `verify` needs to identify the paths.
    virtual bool keeps_paths() const { return true; }
    /// Whether sample() needs nothing that trace(), learn() and prepare() leave, apart from the Russian roulette of joins. Any
    /// sample can then be traced again without the rest of its pass.
    virtual bool samples_alone(const Scene&) const { return false; }
    virtual Estimator estimator() const = 0;
    /// Number of independent groups of passes, for integrators whose passes depend on each other: pass i belongs to
    /// group i modulo this number. 0 if all passes are independent.
    virtual int error_groups() const { return 0; }
    /// Factor of the splats of the last pass in estimates of the error from groups, see Film::end_pass().
    virtual double splat_error_factor() const { return 1; }
    /// Statistics of the integrator by name, as of the last pass; written by --stats.
    virtual std::vector<std::pair<std::string, double>> figures() const { return {}; }
};

/// An integrator with its parameters, as text: `bdpt:max_depth=12,rr_depth=5`. Parameters are checked against the table
/// of the integrator.
struct IntegratorSpec {
    std::string name;
    std::map<std::string, std::string> params;
    /// Makes an integrator that is not in the registry; otherwise empty.
    std::function<std::unique_ptr<Integrator>(const std::map<std::string, std::string>& params)>
        make = nullptr;
    /// The guide of an integrator with guide=on, which takes it as it is and learns none; otherwise empty. For tests, and for
    /// the pilots of `auto`.
    std::shared_ptr<const Guide> guide = nullptr;
    /// For the pilots of `auto`; otherwise empty.
    std::shared_ptr<SharedByPilots> shared_by_pilots = nullptr;

    /// Throws std::runtime_error with one clear message.
    static IntegratorSpec parse(const std::string& text);
    std::string to_string() const;
};

/// One of the allowed values of a text parameter, and its meaning.
template <class T>
struct Choice {
    const char* name;
    T value;
};

/// Typed access to the parameters of a spec. Parameters that are not given have the defaults of the table.
class IntegratorParams {
public:
    IntegratorParams(const IntegratorSpec& spec, const PluginInfo& info);
    /// Whether the integrator has this parameter.
    bool has(const char* name) const { return values_.count(name) > 0; }
    int integer(const char* name) const;
    float number(const char* name) const;
    bool flag(const char* name) const;
    const std::string& string(const char* name) const { return text(name); }
    template <class T, size_t N>
    T choice(const char* name, const std::array<Choice<T>, N>& choices) const {
        std::vector<std::string> known;
        for (const Choice<T>& c : choices) {
            if (text(name) == c.name) return c.value;
            known.push_back(c.name);
        }
        refuse_choice(name, known);
    }
    /// Like integer() and number(), but throws if the value is outside [low, high].
    int integer(const char* name, int low, int high) const;
    float number(const char* name, float low, float high) const;
    const std::string& integrator() const { return integrator_; }
    const std::shared_ptr<const Guide>& given_guide() const { return guide_; }
    const std::shared_ptr<SharedByPilots>& shared_by_pilots() const { return shared_by_pilots_; }

private:
    [[noreturn]] void refuse_choice(const char* name, const std::vector<std::string>& known) const;
    const std::string& text(const char* name) const;
    std::map<std::string, std::string> values_;
    std::string integrator_;
    std::shared_ptr<const Guide> guide_;
    std::shared_ptr<SharedByPilots> shared_by_pilots_;
};

struct IntegratorEntry {
    PluginInfo info;
    std::unique_ptr<Integrator> (*make)(const IntegratorParams& params);
};
/// All integrators but `auto`, which chooses one of them.
const std::vector<IntegratorEntry>& integrator_registry();
/// Also of `auto`. Throws std::runtime_error for an unknown name.
const IntegratorEntry& integrator_entry(const std::string& name);
std::unique_ptr<Integrator> make_integrator(const IntegratorSpec& spec);

/// Maximum path length and start of Russian roulette; parameters of all integrators.
struct DepthOptions {
    int max_depth;  ///< Edges of the longest path; kUnlimited if there is no limit.
    int rr_depth;
    bool has_roulette = true;  ///< Whether walks have any; see WalkOptions.

    /// Without roulette where the integrator has no parameter rr_depth.
    static DepthOptions from(const IntegratorParams& params);
    /// Limits of walks: sub-paths end at the last vertex that can be part of a path of max_depth edges.
    WalkOptions walk() const {
        return {max_depth == kUnlimited ? kUnlimited : max_depth + 1, rr_depth, has_roulette};
    }
    static constexpr int kUnlimited = 1 << 20;
};
std::vector<ParamInfo> depth_params(const char* rr_depth = "5");
/// The same for methods that join two sub-paths. The number of joins is the product of their lengths, and most of those of
/// long ones contribute little: Russian roulette begins at the second scattering.
std::vector<ParamInfo> sub_path_params();

}  // namespace etendue
