#include "session/replay.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <stdexcept>

#include <fmt/format.h>

namespace etendue {
namespace {

/// Keeps the joins of one pixel.
class PathRecorder final : public ContributionSink {
public:
    PathRecorder(const Film& film, uint64_t pixel, size_t most, const Workspace& work,
                 Replay& result)
        : film_(film), pixel_(pixel), most_(most), work_(work), result_(result) {}

    /// `h`: the factor of the sample's eye path in the pixel.
    void begin(uint32_t pass, bool is_for_splats, float splat_share, float h) {
        pass_ = pass;
        h_ = h;
        is_for_splats_ = is_for_splats;
        splat_share_ = splat_share;
    }

    void add(const Join& join, Rgb contribution) override {
        const bool is_splat = join.technique.t <= 1;
        if (is_splat != is_for_splats_) return;
        float share = splat_share_;
        if (is_splat) {
            float h = 0;
            for_each_pixel(film_.geometry(), film_.filter(), join.film,
                           [&](uint64_t pixel, float value) {
                               if (pixel == pixel_) h = value;
                           });
            share *= h;
        } else {
            share = work_.z.film_weight * h_;
        }
        const Rgb value = contribution * (join.mis_weight * share);
        if (!is_finite(value) || value.is_zero()) return;
        if (!is_splat) result_.sum += value;
        if (result_.paths.size() >= most_) {
            ++result_.left_out;
            return;
        }
        result_.paths.push_back({points(join), join.technique, pass_, join.mis_weight, value});
    }

private:
    /// `is_joined`: the sub-path ends here, though its walk may have gone on by a delta event.
    static ReplayedPath::Point point(const Vertex& v, bool is_joined) {
        return {v.p, v.is_delta && !is_joined ? 'S' : 'D', v.is_infinite};
    }

    /// Hits have all vertices; next events and splats sample the other end, which the join's edge has. Of a pair, z_{t-1}
    /// stays, unless it was dropped.
    std::vector<ReplayedPath::Point> points(const Join& join) const {
        int s = join.technique.s, t = join.technique.t;
        const SubPath& y = work_.light_side(join.technique);
        const bool is_joined = join.technique.strategy != Strategy::Merge &&
                               join.technique.strategy != Strategy::Specular;
        if (is_pair(join.technique.strategy)) --(join.technique.drops_eye ? t : s);
        std::vector<ReplayedPath::Point> list;
        if (join.technique.strategy == Strategy::NextEvent)
            list.push_back({join.b.p, 'L', join.to_infinity});
        else
            for (int i = 0; i < std::min(s, y.size()); ++i)
                list.push_back(point(y[i], i == s - 1 && is_joined));
        if (t == 1)
            list.push_back({join.a.p, 'E', false});
        else
            for (int i = std::min(t, work_.z.size()) - 1; i >= 0; --i)
                list.push_back(point(work_.z[i], i == t - 1));
        if (list.empty()) return list;
        list.front().event = 'L';
        list.back().event = 'E';
        return list;
    }

    const Film& film_;
    uint64_t pixel_;
    size_t most_;
    const Workspace& work_;
    Replay& result_;
    uint32_t pass_ = 0;
    bool is_for_splats_ = false;
    float splat_share_ = 0, h_ = 0;
};

/// Keeps the splats of one pixel.
class SplatRecorder final : public ContributionObserver {
public:
    SplatRecorder(uint32_t pass, uint64_t pixel, size_t most, Replay& result)
        : pass_(pass), pixel_(pixel), most_(most), result_(result) {}
    /// Before any contribution.
    void set_film(const Film& film) { film_ = &film; }

    void observe(const Join& join, Rgb contribution, float share, const FilmTarget&,
                 const Workspace& work) override {
        if (join.technique.t > 1) return;
        const std::lock_guard lock(mutex_);
        PathRecorder one(*film_, pixel_, most_, work, result_);
        one.begin(pass_, true, share, 0);
        one.add(join, contribution);
    }

private:
    uint32_t pass_;
    uint64_t pixel_;
    size_t most_;
    Replay& result_;
    const Film* film_ = nullptr;
    std::mutex mutex_;
};

bool has_roulette_of_joins(const IntegratorSpec& spec) {
    return !spec.make && integrator_entry(spec.name).info.has_param("roulette");
}

void check_pixel(const FilmGeometry& geometry, uint64_t pixel) {
    if (pixel >= geometry.pixel_count())
        throw std::runtime_error("the pixel is not within the image of the run");
}

void sort_by_luminance(Replay& replay) {
    std::sort(replay.paths.begin(), replay.paths.end(),
              [](const ReplayedPath& a, const ReplayedPath& b) {
                  return luminance(a.value) > luminance(b.value);
              });
}

}  // namespace

ReplayedPasses replayed_passes(const IntegratorSpec& spec, const Scene& scene) {
    const std::unique_ptr<Integrator> integrator = make_integrator(spec);
    if (integrator->error_groups() > 0 || !integrator->keeps_paths()) return ReplayedPasses::None;
    return integrator->samples_alone(scene) ? ReplayedPasses::Any : ReplayedPasses::Whole;
}

Replay replay(const Scene& scene, const ReplayRequest& request) {
    if (replayed_passes(request.integrator, scene) != ReplayedPasses::Any)
        throw std::runtime_error(
            fmt::format("paths of {} cannot be traced again without the rest of their pass",
                        request.integrator.name));
    check_pixel(scene.film(), request.pixel);
    IntegratorSpec spec = request.integrator;
    if (has_roulette_of_joins(spec)) spec.params["roulette"] = "0";
    const std::unique_ptr<Integrator> integrator = make_integrator(spec);
    const uint64_t light_paths = integrator->light_paths(scene);
    const float splat_scale = light_paths > 0 ? float(1 / double(light_paths)) : 0.0f;
    // Integrators read it, though nothing is added to it. As in a first pass, it knows of no earlier ones.
    Film film(scene.film(), scene.filter(), 1, request.filter_mode);
    Workspace work;
    work.is_observed = true;
    Replay result;
    PathRecorder recorder(film, request.pixel, request.most_paths, work, result);
    Sampler sampler(request.sampler, request.seed);
    const auto begin = std::chrono::steady_clock::now();
    const auto has_time = [&] {
        const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
        return elapsed.count() < request.seconds;
    };
    const auto begin_pass = [&](uint32_t pass) {
        film.begin_pass(light_paths, film_offset(request.sampler, request.seed, pass));
    };
    const auto trace = [&](uint32_t pass, uint64_t index, bool is_for_splats, float h) {
        recorder.begin(pass, is_for_splats, splat_scale, h);
        sampler.start(pass, index);
        // Chunks matter only to integrators that share light paths.
        const SampleContext c{scene,       film,        film.expected(), index,   0,
                              light_paths, splat_scale, sampler,         recorder};
        integrator->trace_eye_paths({&c, 1}, {&work.z, 1}, work.stats);
        integrator->sample(c, work);
    };
    for (uint32_t i = 0; i < request.passes && has_time(); ++i, ++result.passes) {
        const uint32_t pass = request.first_pass + i;
        begin_pass(pass);
        film.for_each_sample_of(request.pixel,
                                [&](uint64_t index, float h) { trace(pass, index, false, h); });
    }
    begin_pass(request.first_pass);
    if (request.splats)
        // A sample traces the light paths of its own, which are several where there are more than samples.
        for (uint64_t i = 0, n = film.sample_count(); i < std::min(light_paths, n); ++i) {
            if (!has_time()) break;
            trace(request.first_pass, i, true, 0);
            result.light_paths += (light_paths - i + n - 1) / n;
        }
    sort_by_luminance(result);
    return result;
}

Replay replay_last(const Renderer& renderer, uint64_t pixel, size_t most_paths) {
    check_pixel(renderer.film().geometry(), pixel);
    const std::optional<uint32_t> pass = renderer.kept_pass();
    if (!pass)
        throw std::runtime_error(
            renderer.film().passes() == 0
                ? "no pass is finished yet"
                : "the light paths of the last pass are gone, because the pass after it was "
                  "discarded or the run was opened from a file; continue the run for another pass");
    Replay result;
    Workspace work;
    PathRecorder recorder(renderer.film(), pixel, most_paths, work, result);
    renderer.film().for_each_sample_of(pixel, [&](uint64_t index, float h) {
        recorder.begin(*pass, false, 0, h);
        renderer.sample_again(index, work, recorder);
    });
    result.passes = 1;
    sort_by_luminance(result);
    return result;
}

Replay replay_pass(const PassOfRun& of, uint64_t pixel, size_t most_paths,
                   const std::atomic<bool>& drop) {
    RenderSettings settings = of.settings;
    settings.technique_depth = 0;
    settings.meanwhile = nullptr;
    settings.keeps_largest = settings.keeps_generations = false;
    Replay splats;
    SplatRecorder recorder(of.pass, pixel, most_paths, splats);
    settings.observer = &recorder;
    Renderer renderer(*of.scene, settings, make_integrator(settings.integrator));
    recorder.set_film(renderer.film());
    check_pixel(renderer.film().geometry(), pixel);
    renderer.trace_again(of.pass, of.generation, drop);
    Replay result = replay_last(renderer, pixel, most_paths);
    result.light_paths = renderer.light_paths();
    result.left_out += splats.left_out;
    result.paths.insert(result.paths.end(), splats.paths.begin(), splats.paths.end());
    sort_by_luminance(result);
    if (result.paths.size() > most_paths) {
        result.left_out += result.paths.size() - most_paths;
        result.paths.resize(most_paths);
    }
    return result;
}

}  // namespace etendue
