#include "verify/comparisons.h"

#include <algorithm>
#include <set>

#include "verify/tile_means.h"

namespace etendue {
namespace {

/// Effective contributions that a test of one technique needs: unweighted contributions have heavier tails than
/// weighted ones.
constexpr double kEnoughAlone = 4000;

/// Adds `factor` times the light of one class in one run.
void add_class(const std::vector<ContributionTally::TileSum>& tiles, double factor,
               const std::vector<double>& pixels, TileMeans& means) {
    for (size_t i = 0; i < tiles.size(); ++i)
        for (const size_t part : {i, tiles.size()})
            for (size_t k = 0; k < 3; ++k)
                means[part][k] += factor * tiles[i].rgb[k] * pixels.back() / pixels[part];
}

/// Calls use(index, tally) for every tile of a class, with the index of the tile and with that of the image.
template <class Use>
void for_each_part(const std::vector<ContributionTally::TileSum>& tiles, const Use& use) {
    for (size_t i = 0; i < tiles.size(); ++i)
        for (const size_t part : {i, tiles.size()}) use(part, tiles[i].luminance);
}

/// Contributions of both sides to every tile and to the image.
std::vector<SideTallies> tile_tallies(const Sides& sides, const TileGrid& grid) {
    std::vector<SideTallies> found(grid.tiles() + 1);
    for (const IndependentRun& run : sides.method.runs)
        for (const auto& [c, tiles] : run.tiles) {
            const CommonClasses::Class* k = sides.common.find(c);
            if (!k->is_common) continue;
            for_each_part(tiles, [&](size_t part, const Tally& t) {
                found[part].method += t;
                if (!k->is_implied) found[part].implied += t;
            });
        }
    for (size_t i = 0; i < sides.references.size(); ++i)
        for (const IndependentRun& run : sides.references[i].runs)
            for (const auto& [c, tiles] : run.tiles) {
                const CommonClasses::Class* k = sides.common.find(c);
                if (!k || !k->is_common || k->reference != i) continue;
                for_each_part(tiles, [&](size_t part, const Tally& t) {
                    found[part].reference += t;
                    if (k->is_implied) found[part].implied += sides.common.implied_by(i, t);
                });
            }
    return found;
}

/// Counts of independent contributions to every tile, at most.
void limit_counts(const RunSeries& series, const TileMoments& moments,
                  std::vector<double>& counts) {
    for (size_t i = 0; i < counts.size(); ++i)
        for (const Moments& m : moments[i])
            counts[i] = std::min(counts[i], series.most_contributions(m));
}

}  // namespace

void compare_images(const Sides& sides, const TileGrid& grid, MethodReport& report) {
    const std::vector<double> pixels = pixels_of_tiles(grid);
    TileMoments method(grid.tiles() + 1), reference(grid.tiles() + 1);
    for (size_t r = 0; r < sides.method.runs.size(); ++r) {
        const IndependentRun& run = sides.method.runs[r];
        TileMeans means = tile_means(run.pixels, grid);
        for (const auto& [c, tiles] : run.tiles)
            if (!sides.common.contains(c)) add_class(tiles, -1, pixels, means);
        add_run(means, method);

        // The image of the first reference, with the classes compared with other references replaced by theirs.
        means = tile_means(sides.references[0].runs[r].pixels, grid);
        for (size_t i = 0; i < sides.references.size(); ++i)
            for (const auto& [c, tiles] : sides.references[i].runs[r].tiles) {
                const CommonClasses::Class* k = sides.common.find(c);
                const bool serves = k && k->is_common && k->reference == i;
                if (serves != (i == 0)) add_class(tiles, i == 0 ? -1 : 1, pixels, means);
            }
        add_run(means, reference);
    }
    std::vector<double> counts;
    for (const SideTallies& t : tile_tallies(sides, grid)) counts.push_back(t.effective_count());
    limit_counts(sides.method, method, counts);
    compare_tiles(method, reference, counts, grid, report);
}

void compare_images(const RunSeries& method, const ReferenceImage& image, const TileGrid& grid,
                    MethodReport& report) {
    const TileMeans means = tile_means(image.pixels, grid),
                    errors = tile_means(image.variance, grid);
    const std::vector<double> pixels = pixels_of_tiles(grid);
    TileMoments moments(means.size()), reference(means.size());
    std::vector<Tally> tallies(means.size());
    for (size_t i = 0; i < means.size(); ++i)
        for (size_t k = 0; k < 3; ++k)
            reference[i][k] = Moments::estimate(
                means[i][k], image.correlation * errors[i][k] / pixels[i], image.samples);
    for (const IndependentRun& run : method.runs) {
        add_run(tile_means(run.pixels, grid), moments);
        for (const auto& [c, tiles] : run.tiles)
            for_each_part(tiles, [&](size_t part, const Tally& t) { tallies[part] += t; });
    }
    std::vector<double> counts;
    for (const Tally& t : tallies) counts.push_back(t.effective_count());
    limit_counts(method, moments, counts);
    compare_tiles(moments, reference, counts, grid, report);
}

void compare_lengths(const Sides& sides, const VerifyOptions& options,
                     const std::vector<float>& cut_offs, MethodReport& report) {
    const double all = sides.common.left_out([](const PathClass&) { return true; }).light;
    for (int edges = options.shortest; edges <= options.longest; ++edges) {
        const auto belongs = [&](const PathClass& c) { return c.edges == edges; };
        const CommonClasses::LeftOut left = sides.common.left_out(belongs);
        report.lengths.push_back(
            {edges, cut_offs[size_t(edges)], all > 0 ? left.light / all : 0.0, left.out_of_reach,
             left.too_rare,
             WelchTest::of(method_light(sides, belongs), reference_light(sides, belongs),
                           sides.common.found(belongs).effective_count())});
    }
}

void compare_classes(const Sides& sides, MethodReport& report) {
    const auto left = sides.common.left_out([](const PathClass&) { return true; });
    report.out_of_reach = left.out_of_reach;
    report.too_rare = left.too_rare;
    std::map<int, int> compared;  // number of compared classes by path length
    for (const auto& [c, k] : sides.common.all()) compared[c.edges] += k.is_common;
    for (const auto& [c, k] : sides.common.all()) {
        const double share = left.light > 0 ? k.light / left.light : 0.0;
        if (!k.is_common) {
            if (k.light > 0)
                report.untested.push_back({c, share, !k.is_reachable,
                                           k.found.method.effective_count(),
                                           k.found.reference.effective_count()});
        } else if (share >= kTestedShare && compared[c.edges] > 1 &&
                   k.found.effective_count() >= kEnoughOfClass) {
            const auto belongs = [&, &c = c](const PathClass& other) { return other == c; };
            report.classes.push_back(
                {c, share, sides.references[k.reference].spec.name,
                 WelchTest::of(method_light(sides, belongs), reference_light(sides, belongs),
                               k.found.effective_count())});
        }
    }
    std::stable_sort(
        report.untested.begin(), report.untested.end(),
        [](const UntestedClass& a, const UntestedClass& b) { return a.share > b.share; });
}

TechniqueReport compare_technique(const Technique& q, const Sides& sides,
                                  const RunSeries& unthinned) {
    const auto times_made = [&](const PathClass& c) {
        return double(etendue::times_made(q, c, sides.method.counts.pairs.rule));
    };
    const auto is_of_technique = [&](const ContributionTally::Entry& e) {
        return e.technique == q && !e.path_class.has_short_edge;
    };
    const auto is_of_length = [&](const ContributionTally::Entry& e) {
        return e.technique.vertices() == q.vertices();
    };
    /// Index of the reference of a class; empty where the technique cannot make the class.
    const auto reference_of = [&](const PathClass& c) -> std::optional<size_t> {
        const CommonClasses::Class* k = sides.common.find(c);
        if (!k || !k->is_reachable || c.has_short_edge || !can_make(sides.method.counts, q, c))
            return {};
        return k->reference;
    };

    const double fewer = double(sides.method.samples()) / double(unthinned.samples());
    std::map<PathClass, SideTallies> found;
    for (const IndependentRun& r : unthinned.runs)
        for (const ContributionTally::Entry& e : r.entries)
            if (is_of_technique(e)) found[e.path_class].method += e.alone;
    for (auto& [c, f] : found)
        f.method = f.method.with_count_of_at_most(
            unthinned.most_contributions(unthinned.moments([&, &c = c](const IndependentRun& r) {
                double sum = 0;
                for (const ContributionTally::Entry& e : r.entries)
                    if (is_of_technique(e) && e.path_class == c) sum += e.alone.sum;
                return sum;
            })));
    /// Sums over the contributions of a reference that has the technique, too: the light, and the second moment of what the
    /// technique alone contributes, or less.
    struct Expected {
        double sum = 0, squares = 0;
    };
    std::map<PathClass, double> most_counts;  // effective counts of the technique, at most
    double length_total = 0;
    for (const auto& [c, k] : sides.common.all())
        if (c.edges + 1 == q.vertices()) length_total += k.light;
    for (size_t i = 0; i < sides.references.size(); ++i) {
        // A reference with this technique, and at most the same count, implies how many contributions the method has.
        const RunSeries& reference = sides.references[i];
        std::map<PathClass, Expected> expected;
        const bool has_it = reference.counts.of(q) > 0 &&
                            reference.counts.of(q) <= sides.method.counts.of(q) &&
                            sides.common.may_serve(i) && !sides.method.has_chains;
        for (const IndependentRun& r : reference.runs)
            for (const ContributionTally::Entry& e : r.entries) {
                if (!is_of_length(e)) continue;
                if (reference_of(e.path_class) == i)
                    found[e.path_class].reference += e.weighted.scaled(times_made(e.path_class));
                if (has_it && is_of_technique(e))
                    found[e.path_class].implied +=
                        sides.common.implied_by(i, e.alone).from_fewer_samples(fewer);
                if (has_it && !reference.counts.uses_pairs() && reference_of(e.path_class)) {
                    Expected& x = expected[e.path_class];
                    x.sum += e.weighted.sum;
                    x.squares += e.technique == q ? e.of_alone.own : e.of_alone.others;
                }
            }
        // Contributions that are too rare for the method to have had any do not show in its own count.
        const double more_samples = double(unthinned.samples()) / double(reference.samples()) *
                                    double(sides.method.counts.of(q) / reference.counts.of(q));
        for (const auto& [c, x] : expected) {
            if (!(x.squares > 0)) continue;
            double& most = most_counts.try_emplace(c, kInf).first->second;
            most = std::min(most, more_samples * sqr(x.sum) / x.squares);
        }
    }
    for (const auto& [c, most] : most_counts) {
        SideTallies& f = found[c];
        f.method = f.method.with_count_of_at_most(most);
        f.implied = f.implied.with_count_of_at_most(most);
    }
    std::set<PathClass> classes;
    SideTallies all;
    double covered = 0;
    for (const auto& [c, f] : found) {
        if (!reference_of(c) || f.method_count() < kEnoughAlone ||
            f.reference.effective_count() < WelchTest::kEnoughContributions)
            continue;
        classes.insert(c);
        all += f;
        covered += f.reference.sum / times_made(c);
    }

    const Moments method = unthinned.moments([&](const IndependentRun& run) {
        double sum = 0;
        for (const ContributionTally::Entry& e : run.entries)
            if (e.technique == q && classes.contains(e.path_class)) sum += e.alone.sum;
        return sum;
    });
    Moments reference;
    for (size_t r = 0; r < unthinned.runs.size(); ++r) {
        double sum = 0;
        for (size_t i = 0; i < sides.references.size(); ++i)
            for (const ContributionTally::Entry& e : sides.references[i].runs[r].entries)
                if (is_of_length(e) && classes.contains(e.path_class) &&
                    reference_of(e.path_class) == i)
                    sum += e.weighted.sum * times_made(e.path_class);
        reference.add(sum);
    }
    return {q, length_total > 0 ? covered / length_total : 0.0,
            WelchTest::of(method, reference, all.effective_count())};
}

}  // namespace etendue
