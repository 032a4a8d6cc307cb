#pragma once
// States of Markov chains in path space [Veach 1997, ch. 11]: full paths x_0 (emitter) … x_k (lens), with the densities of
// their vertices from either side.
//
// The conventions are those of path_pdfs.h. At a delta event, f and the densities of both sides leave out the factor δ of
// the direction toward the eye given the direction toward the light, and keep the geometry term of the edge behind the
// event. Areas are in units of PathMeasure::unit_area.

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "mcmc/path_density.h"
#include "mcmc/state.h"
#include "mcmc/target_map.h"
#include "mcmc/technique_choice.h"
#include "mcmc/user_paths.h"

namespace etendue {

/// The measure to which densities of paths refer; the same for all states of a space.
struct PathMeasure {
    const Scene& scene;
    FilmRegion film;        ///< Region of the film, in pixels, in which eye paths start.
    int shortest, longest;  ///< Lengths of states, in edges.
    double unit_area;       ///< Square of a typical length of the scene, in squared scene units.

    PathMeasure(const Scene& of, const FilmRegion& region, int shortest_path, int longest_path);
};

class PathState;

/// The target of a path, divided by the density T of large steps. `value` is its contribution to the image, divided by T.
using PathImportance = std::function<double(const PathState& x, Rgb value)>;
/// Luminance times W.
PathImportance weighted_luminance(TargetMap map);

/// Large steps that follow user paths: a part `share` of all. A light sub-path close to one of the paths is joined to an eye
/// sub-path, each vertex of which after the first is sampled with probability `kLonger`.
struct UserSteps {
    static constexpr double kLonger = 0.5;

    std::optional<UserPaths> paths{};
    double share = 0;

    /// Probability of an eye sub-path of t vertices beside s light vertices; paths of fewer than `shortest` edges are not
    /// made.
    static double pmf(int s, int t, int shortest) {
        const int more = t - std::max(1, shortest + 1 - s);
        return more < 0 ? 0.0 : (1 - kLonger) * std::pow(kLonger, more);
    }
};

/// The terms of the target of a path, and the choices of large steps.
struct PathTarget {
    PathMeasure measure;
    PathImportance importance;
    LengthChoice lengths;
    TechniqueChoice techniques;
    UserSteps user{};
    /// Whether photons are stored at a vertex, for photon map proposals; by default wherever it can be connected.
    std::function<bool(const Vertex&)> stores = [](const Vertex& v) { return v.is_connectible; };
};

/// A vertex of a full path.
class PathVertex {
public:
    /// `is_delta` and `event` describe how the path scatters here; x_0 has Kind::Emitter.
    Vertex v;
    /// Probabilities of a delta event from either side.
    float light_pmf = 1, eye_pmf = 1;
    /// The factor of f that belongs to this vertex, with the edge before it, is value · factor: scattering or emission, and
    /// what depends on the scene's size, which exceeds the range of float.
    Rgb value;
    double factor = 1;
    bool is_black() const { return value.is_zero() || !(factor > 0); }
    Rgb attenuation;          ///< On the edge to the next vertex.
    float transmittance = 1;  ///< Of the masks on this edge; 0 if the edge is blocked.
    float opacity = 1;        ///< Probability that a ray meets the surface.

private:
    friend class PathState;
    /// Densities per unit_area of its place, without masks, as sampled from the light's side and from the eye's side. Only
    /// PathState::light() and eye(), which include masks, are densities of a traced path.
    double light_ = 1, eye_ = 1;
    double next_event_ = 0;
};

class PathState final : public ChainState {
public:
    explicit PathState(const PathTarget& target) : target_(target), measure_(target.measure) {}

    int size() const { return int(x_.size()); }
    int last() const { return size() - 1; }  ///< k
    const PathVertex& operator[](int i) const { return x_[size_t(i)]; }
    PathVertex& operator[](int i) { return x_[size_t(i)]; }
    const Emitter& emitter() const { return *x_[0].v.emitter; }
    /// Whether the two ends of the edge from x_i to x_{i+1} can be joined.
    bool is_connected_at(int i) const {
        return !x_[size_t(i)].v.is_delta && !x_[size_t(i) + 1].v.is_delta;
    }
    /// Index of the first vertex before x_i, toward the light, for which `is` holds; 0 if there is none (-1 for i = 0).
    template <class Is>
    int before(int i, const Is& is) const {
        do --i;
        while (i > 0 && !is(x_[size_t(i)].v));
        return i;
    }
    /// Density of x_i per unit_area, as a walk from the light samples it after x_{i-1}: the ray passes the masks of the
    /// edge, and meets the surface. That of x_0 is the density of emission; that of x_k belongs to a ray that hits the lens.
    double light(int i) const { return x_[size_t(i)].light_ * (i == 0 ? 1.0 : met_from_light(i)); }
    /// The same for a walk from the eye, after x_{i+1}. That of x_{k-1} is the density of a film point anywhere on the
    /// film, that of x_0 belongs to a ray that hits the emitter or leaves the scene.
    double eye(int i) const { return x_[size_t(i)].eye_ * (i == last() ? 1.0 : met_from_eye(i)); }
    /// Density of x_0, as next event estimation samples it from x_1.
    double next_event() const { return x_[0].next_event_; }
    /// Density of x_i, i ≥ 1, after x_{i-1}, and of x_i, i < k, after x_{i+1}, if directions have density 1 per steradian.
    double geometry_from_light(int i) const { return geometry(i - 1, i) * met_from_light(i); }
    double geometry_from_eye(int i) const { return geometry(i + 1, i) * met_from_eye(i); }
    /// Probability that a ray from x_{i+1} to x_i passes the masks of the edge and meets x_i.
    double met_from_eye(int i) const {
        return double(x_[size_t(i)].transmittance * x_[size_t(i)].opacity);
    }
    Vec2 film{};

    void clear() {
        x_.clear();
        arena_.reset();
    }
    void append(const Vertex& v);
    void append(const PathVertex& v);
    void copy(const PathState& from);

    /// Computes scattering and densities at x_first … x_last, the vertices that have changed or have a changed neighbour.
    /// False if the path contributes nothing.
    bool evaluate(int first, int last);
    /// Traces the edge from x_i to x_{i+1}. In scenes without masks, only edges that no ray has tested need this.
    bool trace_edge(int i, RenderStats& stats);
    /// Sets the target and the contribution to the film, when everything else is known. Both are divided by the density of
    /// large steps, as if the state were one of primary sample space. Values that are not finite are left out and counted.
    void finish(RenderStats& stats);
    /// Makes this a path that contributes nothing.
    void set_black();
    /// Density with which the technique C(s, k+1-s) samples the path.
    PathDensity density(int s) const;
    /// Density per unit_area with which `paths` sample x_0 … x_{s-1}, to be joined to x_s; zero if these are not joined.
    PathDensity density(const UserPaths& paths, int s) const;
    PathDensity large_step_density() const { return large_step_density_; }
    /// f, the contribution to the image.
    PathProduct contribution() const;
    /// The same for the light sub-path x_0 … x_i: its flux at x_i, without scattering there. i ≥ 1.
    PathProduct flux(int i) const;
    /// Reports the path as the joins of all techniques with their MIS weights, whose sum is its contribution. y and z of
    /// `work` then hold the path.
    void tell(const TechniqueCounts& counts, Workspace& work, ContributionSink& sink) const;

    void save(LearnedState& to) const override;
    void load(LearnedState& from) override;

private:
    /// Whether C(s, k+1-s) can sample the path.
    bool is_sampled_by(int s) const;
    /// Density of the path as a large step.
    PathDensity independent_path_density();
    /// Without masks.
    double geometry(int from, int to) const;
    /// Probability that a ray from x_{i-1} to x_i passes the masks of the edge and meets x_i.
    double met_from_light(int i) const {
        return double(x_[size_t(i) - 1].transmittance * x_[size_t(i)].opacity);
    }
    double arrival(int i) const;
    void scatter(int i);
    Vec3 lens_point() const;

    const PathTarget& target_;
    const PathMeasure& measure_;
    std::vector<PathVertex> x_;
    ComponentArena arena_;
    PathDensity large_step_density_ = 0;
    std::vector<PathDensity> eye_densities_;  ///< Of independent_path_density().
};

}  // namespace etendue
