#pragma once
// States of Markov chains in path space [Veach 1997, ch. 11]: full paths x_0 (emitter) … x_k (lens), with the densities of
// their vertices from either side.
//
// Conventions are those of path_pdfs.h: a delta event leaves out the factor δ of the direction toward the eye given that
// toward the light, in f and in the densities of both sides, and keeps the geometry term of the edge behind it. Areas
// are in units of PathMeasure::unit_area, so that products over long paths stay within the range of numbers.

#include "mcmc/state.h"
#include "mcmc/target_map.h"
#include "mcmc/technique_choice.h"

namespace etendue {

/// What densities of paths refer to; the same for all states of a space.
struct PathMeasure {
    const Scene& scene;
    FilmRegion film;        ///< Where eye paths start.
    int shortest, longest;  ///< Lengths of states, in edges.
    double unit_area;       ///< Square of a typical length of the scene.

    PathMeasure(const Scene& of, const FilmRegion& region, int shortest_path, int longest_path);
};

/// What the target of a path is made of: W, and how large steps choose length and technique.
struct PathTarget {
    PathMeasure measure;
    TargetMap map;
    LengthChoice lengths;
    TechniqueChoice techniques;
};

/// A vertex of a full path.
struct PathVertex {
    /// `is_delta` and `event` are of the path's scattering here; x_0 is of Kind::Emitter.
    Vertex v;
    /// Densities as sampled from the light's side and from the eye's. That of x_{k-1} from x_k is spread over the film.
    double light = 1, eye = 1;
    double next_event = 0;  ///< Of x_0: its density as next events from x_1 sample it.
    /// Probabilities of a delta event from either side.
    float light_pmf = 1, eye_pmf = 1;
    /// The factor of f that belongs to this vertex, with the edge before it.
    Rgb value;
    Rgb attenuation;          ///< On the edge to the next vertex.
    float transmittance = 1;  ///< Of masks there; 0 where the edge is blocked.
    float opacity = 1;        ///< Probability that a ray meets the surface.
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
    /// Density of x_i given x_{i+1}, or x_{i-1}, where one direction is sampled with density 1 per solid angle.
    double geometry_from_eye(int i) const { return geometry(i + 1, i); }
    double geometry_from_light(int i) const { return geometry(i - 1, i); }
    Vec2 film{};

    void clear() {
        x_.clear();
        arena_.reset();
    }
    void append(const Vertex& v);
    void append(const PathVertex& v);
    void copy(const PathState& from);

    /// Computes scattering and densities at x_first … x_last, where vertices or their neighbours have changed. False where
    /// the path brings nothing.
    bool evaluate(int first, int last);
    /// Traces the edge from x_i to x_{i+1}. Where nothing is masked, only those edges need it that no ray has found.
    bool trace_edge(int i, RenderStats& stats);
    /// Sets the target and what the path adds to the film, once all else is known. Both are relative to the density of
    /// large steps, as if they were states of primary sample space.
    void finish();
    /// Makes the path one that brings nothing.
    void set_black();
    /// Density of the path among those sampled from both ends by C(s, k+1-s).
    double density(int s) const;
    double large_step_density() const { return large_step_density_; }
    /// As the joins of all techniques with their weights, whose sum it is; y and z of `work` become the path.
    void tell(const TechniqueCounts& counts, Workspace& work, ContributionSink& sink) const;

    void save(LearnedState& to) const override;
    void load(LearnedState& from) override;

private:
    double geometry(int from, int to) const;
    void scatter(int i);
    Vec3 lens_point() const;

    const PathTarget& target_;
    const PathMeasure& measure_;
    std::vector<PathVertex> x_;
    ComponentArena arena_;
    double large_step_density_ = 0;
    std::array<double, 3> f_{};
};

}  // namespace etendue
