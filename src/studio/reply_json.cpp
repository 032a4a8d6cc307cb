#include "studio/reply_json.h"

#include <algorithm>

#include <fmt/format.h>

#include "render/method_choice.h"
#include "render/render_request.h"
#include "studio/guard.h"

namespace etendue {
namespace {

using nlohmann::json;

json to_json(const ErrorEstimate& e) {
    return e.valid ? json::array({e.relative_rms, e.low, e.high}) : json(nullptr);
}

const char* name_of(Strategy strategy) {
    switch (strategy) {
    case Strategy::Hit: return "hit";
    case Strategy::NextEvent: return "next event";
    case Strategy::Connect: return "connect";
    case Strategy::Splat: return "splat";
    case Strategy::HitLens: return "hit lens";
    case Strategy::Merge: return "merge";
    case Strategy::Gather: return "gather";
    case Strategy::Specular: return "specular";
    }
    return "";
}

json to_json(const RayPoint& p) {
    json j{{"point", to_json(p.p)}, {"normal", to_json(p.ng)}, {"shape", p.shape},
           {"emits", p.emits},      {"delta", p.is_specular},  {"events", json::array()}};
    for (const RayPoint::Event& e : p.events)
        j["events"].push_back({{"event", e.number % 2 == 1 ? "refraction" : "reflection"},
                               {"direction", to_json(e.direction)},
                               {"weight", e.weight}});
    return j;
}

}  // namespace

std::string dump(const json& value) {
    return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

json to_json(Vec3 v) {
    return json::array({v.x, v.y, v.z});
}
json to_json(Rgb c) {
    return json::array({c.r, c.g, c.b});
}

json progress_of(const RunStatus& s) {
    json j{{"id", s.id},
           {"state", to_string(s.state)},
           {"passes", s.passes},
           {"snapshot", s.snapshot_passes},
           {"seconds", s.seconds},
           {"rays", s.rays_per_second},
           {"error", to_json(s.error)}};
    if (s.fraction) j["fraction"] = *s.fraction;
    if (s.seeds > 1) j["seeds"] = {s.finished_seeds, s.seeds};
    if (!s.file.empty()) j["file"] = s.file;
    if (!s.file.empty()) j["file_passes"] = s.file_passes;
    // Also where they are no longer so: the page keeps what it was told before.
    j["message"] = s.message;
    j["old_scene"] = !s.is_of_this_scene;
    j["file_problem"] = s.file_problem;
    return j;
}

json to_json(const KeptRun& run) {
    if (!run.problem.empty()) return {{"file", run.file}, {"problem", run.problem}};
    if (!is_file_name(run.file))
        return {{"file", run.file},
                {"problem", "its name must have only letters, digits, '.', '_' and '-'"}};
    json j = {{"file", run.file},
              {"integrator", run.integrator},
              {"seed", run.seed},
              {"passes", run.passes}};
    if (run.seeds > 1) j["seeds"] = {run.finished_seeds, run.seeds};
    return j;
}

json to_json(int id, const OpenedImage& image) {
    return {{"id", id},
            {"file", image.file},
            {"note", image.note},
            {"width", image.pixels->width},
            {"height", image.pixels->height}};
}

json to_json(const RunStatus& s) {
    json j = progress_of(s);
    j["integrator"] = s.request.integrator;
    if (s.choice) {
        j["auto"] = json::parse(s.choice->to_text());
        j["auto"]["message"] = s.choice->message();
    }
    j["why_look_only"] = s.why_look_only;
    j["warnings"] = s.warnings;
    j["sampler"] = to_string(s.request.sampler);
    j["filter_mode"] = to_string(s.request.filter_mode);
    j["seed"] = s.request.seed;
    j["techniques"] = s.request.technique_depth;
    j["estimator"] = to_string(s.estimator);
    j["interval"] = to_string(s.interval);
    if (s.request.spp) j["limits"]["spp"] = *s.request.spp;
    if (s.request.seconds) j["limits"]["seconds"] = *s.request.seconds;
    if (s.request.error) j["limits"]["error"] = *s.request.error;
    j["figures"] = json::object();
    for (const auto& [name, value] : s.figures) j["figures"][name] = value;
    j["history"] = json::array();
    for (const ConvergencePoint& p : s.history)
        j["history"].push_back(
            {p.passes, p.seconds, p.error.relative_rms, p.error.low, p.error.high});
    return j;
}

json to_json(const SeedComparison::Method& m, const SeedSeries& series) {
    json mutations = json::object();
    // Figures of the steps by length have longer names.
    const auto add = [&](const std::string& name, double value, const std::string& ending,
                         const char* as) {
        if (name.ends_with(ending) && name.find("_length_") == std::string::npos)
            mutations[name.substr(0, name.size() - ending.size())][as] = value;
    };
    for (const auto& [name, value] : series.figures) {
        add(name, value, "_proposed", "proposed");
        add(name, value, "_accepted", "accepted");
    }
    return {{"seeds", series.luminance.size()},
            {"variance", m.variance},
            {"seconds", m.seconds},
            {"mean", m.mean},
            {"mean_error", m.mean_error},
            {"mutations", mutations}};
}

std::string key_of(const Technique& q) {
    std::string key = fmt::format("{}-{}-{}", name_of(q.strategy), q.s, q.t);
    std::replace(key.begin(), key.end(), ' ', '-');
    return key;
}

json to_json(const Technique& q) {
    return {{"strategy", name_of(q.strategy)}, {"s", q.s}, {"t", q.t}, {"edges", q.vertices() - 1}};
}

json to_json(const std::vector<RayPoint>& points) {
    json list = json::array();
    for (const RayPoint& p : points) list.push_back(to_json(p));
    return list;
}

json to_json(const Replay& r) {
    json paths = json::array();
    for (const ReplayedPath& p : r.paths) {
        json points = json::array();
        std::string type;
        for (const ReplayedPath::Point& v : p.points) {
            points.push_back({v.p.x, v.p.y, v.p.z, v.is_infinite ? 1 : 0});
            type += v.event;
        }
        paths.push_back({{"points", std::move(points)},
                         {"type", type},
                         {"technique", to_json(p.technique)},
                         {"pass", p.pass},
                         {"weight", p.mis_weight},
                         {"value", to_json(p.value)}});
    }
    return {{"paths", std::move(paths)},
            {"sum", to_json(r.sum)},
            {"passes", r.passes},
            {"light_paths", r.light_paths},
            {"left_out", r.left_out}};
}

}  // namespace etendue
