#pragma once
// Integrators: which sub-paths are traced, which techniques join them, how many samples each takes. Nothing else.

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

/// Statistical nature of an estimator; written into reports and images.
enum class Estimator { Unbiased, Consistent, Biased };

class Integrator {
public:
    virtual ~Integrator() = default;
    /// Learns from what earlier passes left: before pass 0, where there is nothing yet, and before passes 1, 4, 16, 64 …
    /// What is learned holds until the next call, and from each call on random numbers are independent of earlier ones:
    /// so no pass depends on its own numbers through what it has learned, and every pass has the right expectation.
    virtual void learn(const LearnContext&) {}
    /// Whether learn() changes what later passes sample or weigh.
    virtual bool is_learning() const { return false; }
    /// Writes what later passes need of earlier ones, between passes: load() into an integrator with the same parameters
    /// makes it go on as this one would. What the film and the statistics keep is not part of it, nor what a pass makes for
    /// itself. load() throws std::runtime_error where the state is of another integrator.
    virtual void save(LearnedState&) const {}
    virtual void load(LearnedState&) {}
    /// Traces what the samples of the pass share. Called by one thread, before them. What it throws, and what samples throw,
    /// drops the pass.
    virtual void trace(const PassContext&) {}

    /// What a worker adds up for learn() during a pass (Workspace::sums); nullptr where nothing is.
    virtual std::unique_ptr<PassSums> make_sums() const { return nullptr; }
    /// Takes over all workers' sums of a finished pass.
    virtual void collect(std::span<const std::unique_ptr<PassSums>>) {}

    /// Traces sample `context.pixel` and reports its contributions.
    virtual void sample(const SampleContext& context, Workspace& work) const = 0;
    /// Samples of each strategy per eye sub-path, as the weights have it, where a pass traces `light_paths`.
    virtual TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const = 0;
    /// Whether it makes paths by this technique.
    virtual bool uses(const Technique& q, const Scene& scene, uint64_t light_paths) const {
        return counts(scene, light_paths).of(q) > 0;
    }
    /// N_L, light paths of a pass; 0 where it traces none.
    virtual uint64_t light_paths(const Scene& scene) const = 0;
    /// Whether contributions come with the sub-paths they were made of, so that `verify` can tell their paths.
    virtual bool keeps_paths() const { return true; }
    virtual Estimator estimator() const = 0;
    /// Where passes depend on each other: of how many independent groups they are, pass i of group i modulo their number.
    /// 0 where each pass is independent.
    virtual int error_groups() const { return 0; }
    /// What splats of the pass just traced count in estimates of errors by groups, see Film::end_pass().
    virtual double splat_error_factor() const { return 1; }
    /// What a run tells of the integrator's own structures, by name; as of the last pass.
    virtual std::vector<std::pair<std::string, double>> figures() const { return {}; }
};

/// An integrator with its parameters, as text: `bdpt:max_depth=12,rr_depth=5`. Checked against the integrator's table.
struct IntegratorSpec {
    std::string name;
    std::map<std::string, std::string> params;
    /// Makes an integrator that is not in the registry; otherwise empty.
    std::function<std::unique_ptr<Integrator>(const std::map<std::string, std::string>& params)>
        make = nullptr;

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
    /// The same without roulette.
    static DepthOptions without_roulette(const IntegratorParams& params);
    /// Vertices of a sub-path that can still be joined.
    WalkOptions walk() const {
        return {max_depth == kUnlimited ? kUnlimited : max_depth + 1, rr_depth};
    }
    static constexpr int kUnlimited = 1 << 20;
};
std::vector<ParamInfo> depth_params();

}  // namespace etendue
