#pragma once
// Comparison of the densities n·p assumed by MIS weights with histograms of the samples. A wrong n changes neither the
// sum of the weights nor the image, only the variance.
//
// Samples of two techniques i, j that make the same paths, of densities n_i p_i and n_j p_j, satisfy for every cell B
//     E[ Σ_{x ~ i, x ∈ B} n_j p_j / (n_i p_i + n_j p_j) ] = ∫_B n_i p_i · n_j p_j / (n_i p_i + n_j p_j) dx
//                                                         = E[ Σ_{x ~ j, x ∈ B} n_i p_i / (n_i p_i + n_j p_j) ],
// with terms of at most 1. Here j are the next events of `path`, or its hits where no next event can make the path, and
// B are tiles of the film.

#include <array>
#include <map>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "math/statistics.h"
#include "path_ends.h"
#include "pathspace/path_pdfs.h"
#include "render/renderer.h"

namespace etendue::test {

struct DensityTest {
    Technique technique;
    double ratio;  ///< Of samples made to samples claimed, both as in the sums above.
    double detectable;
    bool deviates;
};

struct DensityTests {
    std::vector<DensityTest> tests;
    /// The largest share, of all runs, of weights that differ from the explicit sum with the counts claimed.
    double wrong_weights = 0;

    /// A few differ by rounding.
    bool has_wrong_weights() const { return !(wrong_weights < 0.02); }
};

/// Counts the samples of one rendering.
class SampleCounter final : public ContributionObserver {
public:
    static constexpr int kTiles = 2, kLongest = 4;
    using Cells = std::array<double, size_t(kTiles* kTiles)>;

    SampleCounter(const Scene& scene, const TechniqueCounts& own, const TechniqueCounts& others)
        : scene_(scene), own_(own), others_(others) {}

    static Technique reference_technique(const PathPdfs& pdfs) {
        const int n = pdfs.vertices();
        const Technique next_event = connection_technique(1, n - 1);
        return n > 2 && pdfs.density(next_event) > 0 ? next_event : connection_technique(0, n);
    }

    void observe(const Join& join, Rgb, float, const FilmTarget&, const Workspace& paths) override {
        const Technique& q = join.technique;
        const int n = q.vertices();
        const FilmGeometry& g = scene_.film();
        const int column = int(std::floor(join.film.x / float(g.width) * kTiles));
        const int row = int(std::floor(join.film.y / float(g.height) * kTiles));
        if (n - 1 > kLongest || std::min(row, column) < 0 || std::max(row, column) >= kTiles)
            return;
        Vertex end;
        std::vector<const Vertex*> x;
        if (q.strategy == Strategy::NextEvent) {
            end = emitter_end(join, paths.z[q.t - 1]);
            x = path_vertices(paths.y, 1, paths.z, q.t, &end);
        } else if (q.strategy == Strategy::Splat) {
            end = lens_end(scene_, join);
            x = path_vertices(paths.y, q.s, paths.z, 1, nullptr, &end);
        } else {
            x = path_vertices(paths.y, q.s, paths.z, q.t);
        }
        std::vector<bool> delta(x.size());
        for (int i = 1; i + 1 < n; ++i)
            delta[size_t(i)] = i != q.s - 1 && i != q.s && x[size_t(i)]->is_delta;
        const PathPdfs pdfs = evaluate_path(scene_, x, delta).pdfs;
        ++weights_;
        wrong_weights_ += !(std::fabs(mis_weight(pdfs, q, own_) - double(join.mis_weight)) < 2e-3);
        const double own = double(own_.of(q)) * pdfs.density(q);
        const size_t cell = size_t(row * kTiles + column);
        const auto add = [&](int s, const Technique& partner, const TechniqueCounts& counts) {
            const double other = double(counts.of(partner)) * pdfs.density(partner);
            cells_[{n, s}][cell] += other / (own + other);
        };
        // As a sample of its own technique, and as one of the technique j that all others are compared with.
        const Technique reference = reference_technique(pdfs);
        add(q.s, reference, others_);
        if (q == reference)
            for (int s = 0; s < n; ++s)
                add(kAsReference + s, connection_technique(s, n - s), others_);
    }

    /// By vertices and s.
    Cells cells(const Technique& q, bool as_reference) const {
        const auto found = cells_.find({q.vertices(), as_reference ? kAsReference + q.s : q.s});
        return found == cells_.end() ? Cells{} : found->second;
    }
    /// Share of weights that differ from the explicit sum with the counts claimed.
    double wrong_weights() const { return double(wrong_weights_) / double(weights_); }

private:
    static constexpr int kAsReference = 1000;
    const Scene& scene_;
    TechniqueCounts own_, others_;
    std::map<std::pair<int, int>, Cells> cells_;
    uint64_t weights_ = 0, wrong_weights_ = 0;
};

/// Tests every technique of `method`; together a false alarm in 1 % of all runs with fresh seeds.
inline DensityTests test_sample_densities(const Scene& scene, const std::string& method) {
    constexpr int kRuns = 24;
    constexpr uint64_t kPasses = 48;
    const std::string longest = fmt::format("max_depth={},rr_depth=100", SampleCounter::kLongest);
    const auto with = [&](const std::string& spec) {
        return IntegratorSpec::parse(spec + (spec.find(':') == std::string::npos ? ":" : ",") +
                                     longest);
    };
    const IntegratorSpec specs[] = {with(method), with("path")};
    TechniqueCounts counts[2];
    for (int i = 0; i < 2; ++i)
        counts[i] = make_integrator(specs[i])->counts(scene, scene.film().pixel_count());

    DensityTests all;
    std::map<int, std::array<std::array<Moments, 2>, std::tuple_size_v<SampleCounter::Cells>>>
        found;  // by vertices · 100 + s
    for (int run = 0; run < kRuns; ++run)
        for (size_t side = 0; side < 2; ++side) {
            SampleCounter counter(scene, counts[side], counts[1 - side]);
            RenderSettings settings;
            settings.integrator = specs[side];
            settings.seed = uint64_t(2 * run) + side;
            settings.threads = 1;
            settings.spp = kPasses;
            settings.observer = &counter;
            Renderer renderer(scene, settings);
            const std::atomic<bool> interrupted{false};
            renderer.run([](const Progress&) {}, interrupted);
            all.wrong_weights = std::max(all.wrong_weights, counter.wrong_weights());
            for (int n = 2; n <= SampleCounter::kLongest + 1; ++n)
                for (int s = 0; s < n; ++s) {
                    const Technique q = connection_technique(s, n - s);
                    if (!(counts[0].of(q) > 0)) continue;
                    const auto cells = counter.cells(q, side == 1);
                    for (size_t c = 0; c < cells.size(); ++c)
                        found[100 * n + s][c][side].add(cells[c]);
                }
        }

    const double level = sidak(0.01, int(found.size() * std::tuple_size_v<SampleCounter::Cells>));
    for (const auto& [key, cells] : found)
        for (const auto& [made, claimed] : cells) {
            if (made.mean() == 0 && claimed.mean() == 0) continue;  // no light there
            const double error = std::sqrt(made.squared_error() + claimed.squared_error());
            all.tests.push_back({connection_technique(key % 100, key / 100 - key % 100),
                                 made.mean() / claimed.mean(), 4 * error / claimed.mean(),
                                 welch_p(made, claimed, 1e-4 * claimed.mean()) < level});
        }
    return all;
}

}  // namespace etendue::test
