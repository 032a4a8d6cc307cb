#include "studio/api.h"

#include <sys/stat.h>
#include <time.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "image/atomic_file.h"
#include "image/flip.h"
#include "image/metrics.h"
#include "math/content_hash.h"
#include "math/statistics.h"
#include "mcmc/pick_paths.h"
#include "render/aov.h"
#include "render/defaults.h"
#include "render/plugin_list.h"
#include "session/first_picture.h"
#include "session/light_ray.h"
#include "session/replay.h"
#include "session/scene_geometry.h"
#include "studio/guard.h"
#include "studio/image_reply.h"
#include "studio/page.h"

namespace etendue {
namespace {

using nlohmann::json;

/// A request that cannot be carried out.
struct ApiError : std::runtime_error {
    ApiError(int status, const std::string& message)
        : std::runtime_error(message), status(status) {}
    int status;
};

/// JSON has no NaN; texts of files may not be UTF-8.
std::string dump(const json& value) {
    return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

double thread_cpu_seconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

json to_json(Vec3 v) {
    return json::array({v.x, v.y, v.z});
}
json to_json(Rgb c) {
    return json::array({c.r, c.g, c.b});
}

Vec3 to_vec(const json& value, const char* name) {
    if (!value.is_array() || value.size() != 3)
        throw ApiError(422, fmt::format("\"{}\" must be [x, y, z]", name));
    Vec3 v;
    for (int i = 0; i < 3; ++i) {
        if (!value[size_t(i)].is_number())
            throw ApiError(422, fmt::format("\"{}\" must be three numbers", name));
        v[i] = value[size_t(i)].get<float>();
        if (!std::isfinite(v[i])) throw ApiError(422, fmt::format("\"{}\" must be finite", name));
    }
    return v;
}

json parse_object(const std::string& text) {
    json body = json::parse(text, nullptr, false);
    if (!body.is_object()) throw ApiError(400, "the body must be a JSON object");
    return body;
}

/// An integer of the body in [low, high]; throws where it is missing, unless there is a fallback.
int64_t integer(const json& body, const char* name, int64_t low, int64_t high,
                std::optional<int64_t> fallback = {}) {
    const auto at = body.find(name);
    if (at == body.end() && fallback) return *fallback;
    // Unsigned numbers above the range of int64_t are above `high` too.
    const bool is_integer =
        at != body.end() && at->is_number_integer() &&
        !(at->is_number_unsigned() && at->get<uint64_t>() > uint64_t(INT64_MAX));
    if (!is_integer || at->get<int64_t>() < low || at->get<int64_t>() > high)
        throw ApiError(422, fmt::format("\"{}\" must be an integer in [{}, {}]", name, low, high));
    return at->get<int64_t>();
}

std::string text_of(const json& body, const char* name, const std::string& fallback = {}) {
    const auto at = body.find(name);
    if (at == body.end()) return fallback;
    if (!at->is_string()) throw ApiError(422, fmt::format("\"{}\" must be a text", name));
    return at->get<std::string>();
}

double positive(const json& body, const char* name) {
    const json& value = body[name];
    if (!value.is_number() || !(value.get<double>() > 0))
        throw ApiError(422, fmt::format("\"{}\" must be a number above 0", name));
    return value.get<double>();
}

int query_integer(const Request& request, const char* name, int fallback) {
    const std::optional<std::string> text = request.query(name);
    if (!text) return fallback;
    int value = 0;
    const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), value);
    if (error != std::errc() || end != text->data() + text->size())
        throw ApiError(400, fmt::format("\"{}\" must be an integer", name));
    return value;
}

RenderLimits limits_of(const json& body) {
    RenderLimits limits;
    if (body.contains("spp")) limits.spp = uint64_t(integer(body, "spp", 1, int64_t(1) << 32));
    if (body.contains("seconds")) limits.seconds = positive(body, "seconds");
    if (body.contains("error")) limits.error = positive(body, "error");
    return limits;
}

json to_json(const ErrorEstimate& e) {
    return e.valid ? json::array({e.relative_rms, e.low, e.high}) : json(nullptr);
}

/// What changes from pass to pass.
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
    if (!s.message.empty()) j["message"] = s.message;
    if (!s.is_of_this_scene) j["old_scene"] = true;
    return j;
}

json to_json(const RunStatus& s) {
    json j = progress_of(s);
    j["integrator"] = s.integrator;
    j["sampler"] = s.sampler == SamplerKind::Sobol ? "sobol" : "independent";
    j["seed"] = s.seed;
    j["techniques"] = s.technique_depth;
    j["estimator"] = to_string(s.estimator);
    j["interval"] = to_string(s.interval);
    if (s.limits.spp) j["limits"]["spp"] = *s.limits.spp;
    if (s.limits.seconds) j["limits"]["seconds"] = *s.limits.seconds;
    if (s.limits.error) j["limits"]["error"] = *s.limits.error;
    j["figures"] = json::object();
    for (const auto& [name, value] : s.figures) j["figures"][name] = value;
    j["history"] = json::array();
    for (const ConvergencePoint& p : s.history)
        j["history"].push_back(
            {p.passes, p.seconds, p.error.relative_rms, p.error.low, p.error.high});
    return j;
}

/// Relative standard error of each pixel's luminance.
std::vector<float> relative_errors(const Snapshot& s) {
    std::vector<float> errors(s.mean.size());
    double mean = 0;
    for (const Rgb c : s.mean) mean += double(luminance(c)) / double(s.mean.size());
    for (size_t i = 0; i < errors.size(); ++i) {
        const float y = luminance(s.mean[i]), scale = std::max(std::abs(y), float(0.1 * mean));
        errors[i] = scale > 0 ? std::sqrt(std::max(0.0f, luminance(s.variance[i]))) / scale : 0.0f;
    }
    return errors;
}

/// Calls use(index) for the pixels of a rectangle.
template <class Use>
void for_each_pixel(const ImageRect& r, int width, const Use& use) {
    for (int y = r.y; y < r.y + r.height; ++y)
        for (int x = r.x; x < r.x + r.width; ++x) use(size_t(y) * size_t(width) + size_t(x));
}

/// The pixels of a rectangle. Pixels that are not finite are counted, and otherwise left out.
struct RectangleValues {
    using Channels = std::array<double, 3>;
    size_t finite = 0, nan = 0, infinite = 0;
    Channels mean{}, least{}, largest{};
    Channels variance{};       ///< Of the pixels.
    Channels squared_error{};  ///< Of the mean, if the errors of pixels are independent.
};
RectangleValues values_in(const Snapshot& s, const ImageRect& rect) {
    RectangleValues v;
    std::array<Moments, 3> moments;
    for_each_pixel(rect, s.width, [&](size_t i) {
        const Rgb c = s.mean[i];
        if (std::isnan(c.r) || std::isnan(c.g) || std::isnan(c.b)) {
            ++v.nan;
            return;
        }
        if (!is_finite(c)) {
            ++v.infinite;
            return;
        }
        for (size_t k = 0; k < 3; ++k) {
            const auto value = double(c[int(k)]);
            v.least[k] = v.finite > 0 ? std::min(v.least[k], value) : value;
            v.largest[k] = v.finite > 0 ? std::max(v.largest[k], value) : value;
            moments[k].add(value);
            v.squared_error[k] += double(s.variance[i][int(k)]);
        }
        ++v.finite;
    });
    for (size_t k = 0; k < 3; ++k) {
        v.mean[k] = moments[k].mean();
        v.variance[k] = moments[k].variance();
        v.squared_error[k] /= sqr(std::max(1.0, double(v.finite)));
    }
    return v;
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

const char* name_of(Strategy strategy) {
    switch (strategy) {
    case Strategy::Hit: return "hit";
    case Strategy::NextEvent: return "next event";
    case Strategy::Connect: return "connect";
    case Strategy::Splat: return "splat";
    case Strategy::HitLens: return "hit lens";
    case Strategy::Merge: return "merge";
    case Strategy::Gather: return "gather";
    }
    return "";
}

json to_json(const Technique& q) {
    return {{"strategy", name_of(q.strategy)}, {"s", q.s}, {"t", q.t}, {"edges", q.vertices() - 1}};
}

/// The paths of a body, within the limits of the protocol.
std::vector<GivenPath> paths_of(const json& list, const std::string& file) {
    constexpr size_t kMostPaths = 1000, kMostPoints = 32;
    if (!list.is_array()) throw ApiError(422, "\"paths\" must be a list");
    if (list.size() > kMostPaths)
        throw ApiError(422, fmt::format("at most {} paths are allowed", kMostPaths));
    std::vector<GivenPath> paths;
    try {
        paths = parse_user_paths(dump(list), file);
    } catch (const std::exception& e) {
        throw ApiError(422, e.what());
    }
    for (const GivenPath& path : paths)
        if (path.points.size() > kMostPoints)
            throw ApiError(422, fmt::format("at most {} points a path are allowed", kMostPoints));
    return paths;
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

template <class T>
void append_bytes(std::string& to, const std::vector<T>& values) {
    to.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    to.append((4 - to.size() % 4) % 4, '\0');
}

/// 4 bytes: the length of the JSON text; the text, filled up with spaces to whole 4 bytes; positions, indices and places.
std::string encode(const std::vector<DrawnShape>& shapes) {
    std::string data;
    json list = json::array();
    for (const DrawnShape& s : shapes) {
        json item{{"shape", s.shape},
                  {"name", s.name},
                  {"low", to_json(s.bounds.lo)},
                  {"high", to_json(s.bounds.hi)},
                  {"color", to_json(s.color)},
                  {"emits", s.emits},
                  {"delta", s.is_specular},
                  {"vertices", s.positions.size() / 3},
                  {"indices", s.triangles.size()},
                  {"positions_at", data.size()}};
        append_bytes(data, s.positions);
        item["indices_at"] = data.size();
        append_bytes(data, s.triangles);
        item["places"] = s.places.size();
        item["places_at"] = data.size();
        append_bytes(data, s.places);
        list.push_back(std::move(item));
    }
    std::string text = dump(list);
    text.append((4 - text.size() % 4) % 4, ' ');
    const auto size = uint32_t(text.size());
    return std::string(reinterpret_cast<const char*>(&size), sizeof size) + text + data;
}

struct PageFile {
    std::string_view path, type, text;
};
const std::array<PageFile, 10>& page_files() {
    constexpr std::string_view kScript = "text/javascript; charset=utf-8";
    static const std::array<PageFile, 10> files{{
        {"/", "text/html; charset=utf-8", kIndexHtml},
        {"/studio.css", "text/css; charset=utf-8", kStudioCss},
        {"/main.js", kScript, kMainJs},
        {"/server.js", kScript, kServerJs},
        {"/view.js", kScript, kViewJs},
        {"/controls.js", kScript, kControlsJs},
        {"/plot.js", kScript, kPlotJs},
        {"/space.js", kScript, kSpaceJs},
        {"/paths.js", kScript, kPathsJs},
        {"/inspector.js", kScript, kInspectorJs},
    }};
    return files;
}

/// Time and size of a file's last change.
std::string fingerprint(const std::string& file) {
    struct stat about {};
    if (::stat(file.c_str(), &about) != 0) return {};
    return fmt::format("{}.{} {} {}", about.st_mtim.tv_sec, about.st_mtim.tv_nsec, about.st_size,
                       about.st_ino);
}

std::string hash_of(const std::string& text) {
    return fmt::format("\"{:016x}\"", ContentHash().add(text).value());
}

}  // namespace

/// What is computed once for a scene, when it is first asked for.
struct Api::SceneData {
    std::shared_ptr<const Scene> scene;
    std::once_flag first, layers, geometry;
    FirstPicture first_picture;
    std::vector<AovImage> aovs;
    std::string geometry_bytes;
};

Api::Api(Session& session, ApiOptions options) : session_(session), options_(std::move(options)) {
    const std::filesystem::path folder = std::filesystem::path(options_.scene_file).parent_path();
    scene_folder_ = folder.empty() ? "." : folder.string();
    fingerprint_ = fingerprint(options_.scene_file);
}

// -- Requests.

bool Api::is_events(const Request& request, std::optional<Reply>& refused) {
    refused = refuse(request, options_.token);
    return !refused && request.method == "GET" && request.path() == "/v1/events";
}

void Api::handle(const Request& request, std::function<void(Reply)> done) try {
    if (auto refused = refuse(request, options_.token)) return done(std::move(*refused));
    const std::string_view path = request.path();
    const bool is_get = request.method == "GET" || request.method == "HEAD";
    for (const PageFile& file : page_files())
        if (path == file.path) {
            if (!is_get) throw ApiError(405, "only GET is possible here");
            return done({200, std::string(file.type), std::string(file.text), {}});
        }
    // Browsers ask for it unbidden, and complain where it is missing.
    if (path == "/favicon.ico") return done({204, {}, {}, {}});
    const auto needs = [&](bool holds) {
        if (!holds) throw ApiError(405, "this method is not possible here");
    };
    if (path == "/v1/state") return needs(is_get), done(state());
    if (path == "/v1/image") return needs(is_get), image(request, done);
    if (path == "/v1/pixel") return needs(is_get), done(pixel(request));
    if (path == "/v1/difference") return needs(is_get), difference(request, done);
    if (path == "/v1/gain") return needs(is_get), gain(request, done);
    if (path == "/v1/techniques") return needs(is_get), done(techniques(request));
    if (path == "/v1/paths") {
        if (request.method == "PUT") return done(put_paths(request));
        return needs(is_get), done(get_paths(request));
    }
    if (path == "/v1/geometry") {
        needs(is_get);
        return later(done, [data = data()] {
            constexpr size_t kMostTriangles = 250'000;
            std::call_once(data->geometry, [&] {
                data->geometry_bytes = encode(drawn_shapes(*data->scene, kMostTriangles));
            });
            return Reply{200, "application/octet-stream", data->geometry_bytes, {}};
        });
    }
    if (path == "/v1/run")
        return needs(request.method == "POST"), done(run(parse_object(request.body)));
    if (path == "/v1/save")
        return needs(request.method == "POST"), save(parse_object(request.body), done);
    for (const char* known :
         {"/v1/ray", "/v1/paths/check", "/v1/paths/snap", "/v1/paths/pick", "/v1/replay"})
        if (path == known) return needs(request.method == "POST"), probe(request, done);
    throw ApiError(404, "there is nothing at this address");
} catch (const ApiError& e) {
    done(Reply::error(e.status, e.what()));
} catch (const std::exception& e) {
    done(Reply::error(422, e.what()));
}

void Api::later(const Done& done, std::function<Reply()> task) {
    const bool is_taken = workers_.post([done, task = std::move(task)] {
        try {
            done(task());
        } catch (const ApiError& e) {
            done(Reply::error(e.status, e.what()));
        } catch (const std::exception& e) {
            done(Reply::error(422, e.what()));
        }
    });
    if (!is_taken) throw ApiError(503, "too many requests wait; try again");
}

std::shared_ptr<const Scene> Api::scene() const {
    if (auto scene = session_.scene()) return scene;
    const std::string error = session_.load_error();
    throw ApiError(503, error.empty() ? "the scene is being loaded" : error);
}

std::shared_ptr<Api::SceneData> Api::data() {
    const std::shared_ptr<const Scene> current = scene();
    const std::lock_guard lock(data_mutex_);
    if (!data_ || data_->scene != current) {
        data_ = std::make_shared<SceneData>();
        data_->scene = current;
    }
    return data_;
}

// -- State and events.

void Api::look_at_scene_file() {
    using namespace std::chrono_literals;
    const auto now = std::chrono::steady_clock::now();
    if (now < looked_ + 2s) return;
    looked_ = now;
    const bool is_changed = fingerprint(options_.scene_file) != fingerprint_;
    if (is_changed != is_scene_changed_) ++own_revision_;
    is_scene_changed_ = is_changed;
}

uint64_t Api::revision() {
    look_at_scene_file();
    return session_.revision() + own_revision_;
}

std::string Api::event() {
    json runs = json::array();
    for (const RunStatus& s : session_.runs()) runs.push_back(progress_of(s));
    return dump({{"runs", runs},
                 {"loaded", session_.scene() != nullptr},
                 {"load_error", session_.load_error()},
                 {"scene_changed", is_scene_changed_},
                 {"paths", paths_versions_}});
}

Reply Api::state() {
    json j{{"version", 1},
           {"scene_file", std::filesystem::path(options_.scene_file).filename().string()},
           {"load_error", session_.load_error()},
           {"scene_changed", is_scene_changed_},
           {"has_reference", options_.reference.has_value()},
           {"scene", nullptr}};
    if (const auto scene = session_.scene()) {
        const FilmGeometry& g = scene->film();
        const bool is_empty = scene->bounds().is_empty();
        j["scene"] = {{"width", g.crop_width},
                      {"height", g.crop_height},
                      {"crop", {g.crop_x, g.crop_y}},
                      {"shapes", scene->shapes().size()},
                      {"emitters", scene->emitters().size()},
                      {"center", to_json(is_empty ? Vec3() : scene->bounds().center())},
                      {"radius", is_empty ? 1.0f : scene->bounds().radius()},
                      {"warnings", scene->warnings()},
                      {"integrator", scene->defaults().integrator}};
        const SensorRay eye =
            scene->sensor().sample_ray({float(g.width) / 2, float(g.height) / 2}, {0.5f, 0.5f});
        j["scene"]["eye"] = to_json(eye.p);
        j["scene"]["look"] = to_json(eye.d);
    }
    j["runs"] = json::array();
    for (const RunStatus& s : session_.runs()) j["runs"].push_back(to_json(s));
    j["integrators"] =
        json::parse(etendue::to_json(choose_plugins(plugin_list(), "integrator", "")).dump());
    j["layers"] = json::array();
    for (const AovInfo& a : aov_registry())
        j["layers"].push_back({{"name", a.name}, {"doc", a.doc}});
    return Reply::json(dump(j));
}

// -- Images and pixels.

void Api::image(const Request& request, const Done& done) {
    // The budget of snapshots includes all that this thread does, so what it did since the last image.
    const double cpu = thread_cpu_seconds();
    if (charged_ > 0 && cpu > charged_) session_.spent(cpu - charged_);
    charged_ = cpu;

    const std::shared_ptr<SceneData> data = this->data();
    const FilmGeometry& g = data->scene->film();
    ImageHeader header;
    header.width = g.crop_width, header.height = g.crop_height;
    header.rect = {0, 0, g.crop_width, g.crop_height};
    header.level = query_integer(request, "level", 0);
    if (const auto rect = request.query("rect")) {
        ImageRect& r = header.rect;
        if (std::sscanf(rect->c_str(), "%9d,%9d,%9d,%9d", &r.x, &r.y, &r.width, &r.height) != 4)
            throw ApiError(400, "\"rect\" must be x,y,width,height");
    }
    check(header);
    const std::string view = request.query("view").value_or("image");
    const auto reply = [&](std::string body) {
        done({200, "application/octet-stream", std::move(body), {}});
    };
    if (view == "first")
        return later(done, [data] {
            std::call_once(data->first, [&] { data->first_picture = first_picture(*data->scene); });
            const FirstPicture& p = data->first_picture;
            ImageHeader small;
            small.width = p.width, small.height = p.height;
            small.rect = {0, 0, p.width, p.height};
            return Reply{200, "application/octet-stream", encode_image(small, p.pixels), {}};
        });
    if (view == "reference") {
        if (!options_.reference) throw ApiError(404, "there is no reference");
        return reply(encode_image(header, options_.reference->pixels));
    }
    for (const AovInfo& a : aov_registry())
        if (view == a.name && view != "variance")
            return later(done, [data, header, view] {
                std::call_once(data->layers, [&] {
                    std::vector<std::string> names;
                    for (const AovInfo& info : aov_registry()) names.push_back(info.name);
                    constexpr int kSamples = 4;
                    data->aovs = render_aovs(*data->scene, names, kSamples, 0, 1);
                });
                for (const AovImage& image : data->aovs)
                    if (image.name == view)
                        return Reply{200,
                                     "application/octet-stream",
                                     encode_image(header, image.pixels),
                                     {}};
                throw ApiError(404, "there is no such layer");
            });

    const int id = query_integer(request, "run", 0);
    const auto after = uint64_t(query_integer(request, "after", 0));
    header.run = uint32_t(id);
    const auto send = [&](uint64_t passes, int width, int height, const auto& pixels) {
        header.passes = passes;
        // A run of a scene that was loaded before may have another size.
        if (width != header.width || height != header.height)
            throw ApiError(409, "the run belongs to a scene of another size");
        reply(encode_image(header, std::span(std::as_const(pixels))));
    };
    const bool is_length = view.starts_with("length:");
    if (is_length || view.starts_with("technique:") || view.starts_with("unweighted:")) {
        const auto shown = session_.techniques(id);
        if (!shown || shown->passes <= after) return done({204, {}, {}, {}});
        const std::string number = view.substr(view.find(':') + 1);
        int index = -1;
        std::from_chars(number.data(), number.data() + number.size(), index);
        if (!is_length) {
            if (index < 0 || size_t(index) >= shown->images.size())
                throw ApiError(404, "there is no such technique");
            const TechniqueImages::Entry& e = shown->images[size_t(index)];
            return send(shown->passes, header.width, header.height,
                        view[0] == 't' ? e.weighted : e.unweighted);
        }
        std::vector<Rgb> sum(g.pixel_count());
        for (const TechniqueImages::Entry& e : shown->images)
            if (e.technique.vertices() - 1 == index && e.weighted.size() == sum.size())
                for (size_t i = 0; i < sum.size(); ++i) sum[i] += e.weighted[i];
        return send(shown->passes, header.width, header.height, sum);
    }
    const auto snapshot = session_.snapshot(id);
    if (!snapshot || snapshot->passes <= after) return done({204, {}, {}, {}});
    if (view == "image")
        return send(snapshot->passes, snapshot->width, snapshot->height, snapshot->mean);
    if (view == "variance")
        return send(snapshot->passes, snapshot->width, snapshot->height, snapshot->variance);
    if (view == "error")
        return send(snapshot->passes, snapshot->width, snapshot->height,
                    relative_errors(*snapshot));
    throw ApiError(404, fmt::format("there is no view \"{}\"", view));
}

Reply Api::pixel(const Request& request) {
    const int x = query_integer(request, "x", -1), y = query_integer(request, "y", -1),
              w = query_integer(request, "w", 1), h = query_integer(request, "h", 1),
              id = query_integer(request, "run", 0);
    const auto snapshot = session_.snapshot(id);
    if (!snapshot) return Reply::json(dump({{"run", id}, {"passes", 0}}));
    check(ImageHeader{.run = 0,
                      .passes = 0,
                      .width = snapshot->width,
                      .height = snapshot->height,
                      .rect = {x, y, w, h},
                      .level = 0});
    const RunStatus status = session_.status(id);
    const RectangleValues values = values_in(*snapshot, {x, y, w, h});
    json j{{"run", id},           {"passes", snapshot->passes},
           {"mean", values.mean}, {"interval", to_string(status.interval)},
           {"half", nullptr},     {"pixels", int64_t(w) * int64_t(h)},
           {"nan", values.nan},   {"infinite", values.infinite}};
    if (values.finite > 1) {
        j["least"] = values.least;
        j["largest"] = values.largest;
        j["variance"] = values.variance;
    }
    if (snapshot->passes >= 2 && status.interval != IntervalKind::None && values.finite > 0) {
        for (size_t c = 0; c < 3; ++c)
            j["half"][c] = interval_half_width(values.squared_error[c], snapshot->passes);
    }
    if (options_.reference && options_.reference->width == snapshot->width &&
        options_.reference->height == snapshot->height) {
        std::array<double, 3> value{};
        for_each_pixel({x, y, w, h}, snapshot->width, [&](size_t i) {
            for (int c = 0; c < 3; ++c)
                value[size_t(c)] +=
                    double(options_.reference->pixels[i][c]) / (double(w) * double(h));
        });
        j["reference"] = value;
    }
    return Reply::json(dump(j));
}

void Api::difference(const Request& request, const Done& done) {
    const auto snapshot = session_.snapshot(query_integer(request, "run", 0));
    const std::string against = request.query("against").value_or("");
    std::shared_ptr<const Snapshot> other;
    if (against != "reference")
        other = session_.snapshot(query_integer(request, "against", 0));
    else if (!options_.reference)
        throw ApiError(404, "there is no reference");
    if (!snapshot || (against != "reference" && !other))
        throw ApiError(422, "one of the images has no finished pass yet");
    const std::span<const Rgb> reference = other ? other->mean : options_.reference->pixels;
    const int width = other ? other->width : options_.reference->width;
    if (width != snapshot->width || reference.size() != snapshot->mean.size())
        throw ApiError(409, "the images differ in size");
    later(done, [snapshot, other, reference] {
        const ImageErrors errors = image_errors(snapshot->mean, reference);
        const FlipResult flip =
            hdr_flip(snapshot->mean, reference, snapshot->width, snapshot->height);
        return Reply::json(dump({{"rel_mse", errors.rel_mse},
                                 {"not_finite", errors.not_finite},
                                 {"flip", flip.mean},
                                 {"passes", snapshot->passes},
                                 {"against_passes", other ? other->passes : 0}}));
    });
}

void Api::gain(const Request& request, const Done& done) {
    const auto without = session_.seed_series(query_integer(request, "without", 0)),
               with = session_.seed_series(query_integer(request, "with", 0));
    later(done, [without, with] {
        const SeedComparison c = compare(*without, *with);
        json j{{"without", to_json(c.a, *without)},
               {"with", to_json(c.b, *with)},
               {"means_differ", c.means_differ}};
        if (c.is_valid) j["ratio"] = c.ratio, j["gain"] = {c.gain, c.low, c.high};
        return Reply::json(dump(j));
    });
}

Reply Api::techniques(const Request& request) {
    const auto shown = session_.techniques(query_integer(request, "run", 0));
    json list = json::array();
    if (shown)
        for (size_t i = 0; i < shown->images.size(); ++i) {
            json item = to_json(shown->images[i].technique);
            double sum = 0;
            for (const Rgb c : shown->images[i].weighted) sum += double(luminance(c));
            item["index"] = i;
            item["mean"] = sum / double(shown->images[i].weighted.size());
            list.push_back(std::move(item));
        }
    return Reply::json(dump({{"passes", shown ? shown->passes : 0}, {"techniques", list}}));
}

// -- Runs.

std::vector<std::string> Api::folders() const {
    return {options_.output_folder, scene_folder_};
}

RunRequest Api::run_request(const json& body) const {
    RunRequest request;
    const std::string text = text_of(body, "integrator");
    // Files are named, not addressed: they come from two folders only.
    if (IntegratorSpec spec = IntegratorSpec::parse(text.empty() ? "path" : text); !text.empty()) {
        if (const auto file = spec.params.find("user_paths"); file != spec.params.end()) {
            if (!file->second.empty()) {
                request.user_paths = find_file_in(folders(), file->second);
            }
            spec.params.erase(file);
        }
        request.integrator = spec.to_string();
    }
    const std::string sampler = text_of(body, "sampler", "sobol");
    const auto kind = sampler_kind(sampler);
    if (!kind)
        throw ApiError(
            422, fmt::format("\"sampler\" must be independent or sobol, but is \"{}\"", sampler));
    request.sampler = *kind;
    request.seed = uint64_t(integer(body, "seed", 0, INT64_MAX, 0));
    request.limits = limits_of(body);
    constexpr int kMostDepth = 64;
    request.technique_depth = int(integer(body, "techniques", 0, kMostDepth, 0));
    constexpr int kMostSeeds = 64;
    request.seeds = int(integer(body, "seeds", 1, kMostSeeds, 1));
    if (request.seeds > 1 && !request.limits.spp && !request.limits.seconds)
        throw ApiError(422, "several seeds need \"spp\" or \"seconds\" for each");
    return request;
}

Reply Api::run(const json& body) {
    const std::string action = text_of(body, "action");
    if (action == "start") {
        const int id = session_.start(run_request(body));
        return Reply::json(dump({{"run", id}}));
    }
    if (action == "reload") {
        fingerprint_ = fingerprint(options_.scene_file);
        looked_ = {};
        session_.reload();
        return Reply::json("{}");
    }
    const int id = int(integer(body, "run", 1, INT32_MAX));
    if (action == "stop")
        session_.stop(id);
    else if (action == "discard")
        session_.discard(id);
    else if (action == "continue")
        session_.resume(id, limits_of(body));
    else if (action == "remove")
        session_.remove(id);
    else
        throw ApiError(422, "\"action\" must be start, stop, continue, discard, remove or reload");
    return Reply::json(dump({{"run", id}}));
}

void Api::save(const json& body, const Done& done) {
    const std::string name = text_of(body, "file");
    if (!is_file_name(name))
        throw ApiError(422, fmt::format("\"{}\" is no name of a file: only letters, digits, '.', "
                                        "'_' and '-' are allowed, without a leading dot",
                                        name));
    check_image_extension(name);
    session_.save(
        int(integer(body, "run", 1, INT32_MAX)), options_.output_folder + "/" + name,
        [done, name](const std::string& error) {
            done(error.empty() ? Reply::json(dump({{"file", name}})) : Reply::error(422, error));
        });
}

// -- User paths.

std::string Api::paths_text(const std::string& name) const {
    try {
        return read_file_in(folders(), name);
    } catch (const std::runtime_error&) {
        if (!is_file_name(name)) throw;
        return "[]";
    }
}

Reply Api::get_paths(const Request& request) {
    const std::string name = request.query("file").value_or("paths.json");
    const std::string text = paths_text(name);
    // As the program reads them, so that errors are found here.
    const std::string list = etendue::to_json(parse_user_paths(text, name));
    return {200, "application/json", list, hash_of(list)};
}

Reply Api::put_paths(const Request& request) {
    const std::string name = request.query("file").value_or("paths.json");
    if (!is_file_name(name)) throw ApiError(422, "this is no name of a file");
    if (!name.ends_with(".json")) throw ApiError(422, "the name must end with .json");
    const json list = json::parse(request.body, nullptr, false);
    const std::string text = etendue::to_json(paths_of(list, name));
    const std::string current = etendue::to_json(parse_user_paths(paths_text(name), name));
    if (request.if_match != hash_of(current))
        return {409, "application/json", current, hash_of(current)};
    write_file_atomically(options_.output_folder + "/" + name, text);
    ++paths_versions_[name];
    ++own_revision_;
    return {200, "application/json", text, hash_of(text)};
}

// -- Rays, paths and replays, in the workers.

void Api::probe(const Request& request, const Done& done) {
    const std::string path(request.path());
    const std::shared_ptr<const Scene> scene = this->scene();
    const json body = parse_object(request.body);
    constexpr int kMostPoints = 16;
    const FilmGeometry& g = scene->film();
    const auto pixel = [&] {
        return std::pair{int(integer(body, "x", 0, g.crop_width - 1)),
                         int(integer(body, "y", 0, g.crop_height - 1))};
    };
    if (path == "/v1/ray") {
        if (body.contains("x")) {
            const auto [x, y] = pixel();
            const Vec2 film = g.pixel_center(g.pixel_index(x, y));
            return later(done, [=] {
                return Reply::json(
                    dump({{"points", to_json(trace_eye(*scene, film, kMostPoints))}}));
            });
        }
        const Vec3 origin = to_vec(body.value("origin", json()), "origin"),
                   direction = to_vec(body.value("direction", json()), "direction");
        if (!(length(direction) > 0)) throw ApiError(422, "\"direction\" must not be zero");
        const bool follows = body.value("trace", json(false)) == json(true);
        return later(done, [=] {
            return Reply::json(
                dump({{"points", to_json(trace_light(*scene, origin, normalize(direction),
                                                     follows ? kMostPoints : 1))}}));
        });
    }
    if (path == "/v1/paths/check") {
        return later(done, [scene, given = paths_of(body.value("paths", json()), "paths")] {
            json verdicts = json::array();
            for (const GivenPath& one : given) {
                const CheckedPath checked = check_user_path(*scene, one);
                if (checked.path)
                    verdicts.push_back({{"ok", true}});
                else
                    verdicts.push_back(
                        {{"ok", false}, {"point", checked.point}, {"problem", checked.problem}});
            }
            return Reply::json(dump({{"verdicts", verdicts}}));
        });
    }
    if (path == "/v1/paths/snap") {
        json list = json::array({json{{"points", body.value("points", json())}}});
        std::vector<GivenPath> given = paths_of(list, "points");
        const auto index = size_t(integer(body, "index", 0, 31));
        return later(done, [scene, given = std::move(given[0]), index] {
            const Snapped snapped = snap(*scene, given.points, index);
            json points = json::array();
            for (const Vec3 p : snapped.points) points.push_back(to_json(p));
            json reply{{"points", points}};
            if (!snapped.problem.empty()) reply["problem"] = snapped.problem;
            return Reply::json(dump(reply));
        });
    }
    if (path == "/v1/paths/pick") {
        const auto [x, y] = pixel();
        PickOptions pick;
        pick.x = x + g.crop_x, pick.y = y + g.crop_y;
        pick.length = int(integer(body, "length", 2, 16, 3));
        pick.count = int(integer(body, "count", 1, 100, 8));
        pick.samples = 20000;
        pick.seed = uint64_t(integer(body, "seed", 0, INT64_MAX, 0));
        return later(done, [scene, pick] {
            return Reply::json(etendue::to_json(pick_paths(*scene, pick)));
        });
    }
    replay_pixel(body, done);
}

void Api::replay_pixel(const json& body, const Done& done) {
    const std::shared_ptr<const Scene> scene = this->scene();
    const FilmGeometry& g = scene->film();
    const int run = int(integer(body, "run", 1, INT32_MAX));
    const RunStatus status = session_.status(run);
    if (!status.is_of_this_scene)
        throw ApiError(409, "the run belongs to an earlier version of the scene");
    const uint64_t pixel = g.pixel_index(int(integer(body, "x", 0, g.crop_width - 1)),
                                         int(integer(body, "y", 0, g.crop_height - 1)));
    constexpr size_t kMostPaths = 10000;
    const auto most = size_t(integer(body, "most", 1, kMostPaths, 1000));
    const IntegratorSpec integrator = IntegratorSpec::parse(status.integrator);
    switch (replayed_passes(integrator)) {
    case ReplayedPasses::None:
        throw ApiError(422, fmt::format("paths of {} cannot be traced again: they are states of "
                                        "Markov chains, or are not kept",
                                        integrator.name));
    case ReplayedPasses::Last:
        return session_.replay_last(run, pixel, most,
                                    [done](const Replay& paths, const std::string& error) {
                                        if (!error.empty()) return done(Reply::error(422, error));
                                        json j = to_json(paths);
                                        j["is_last_pass"] = true;
                                        done(Reply::json(dump(j)));
                                    });
    case ReplayedPasses::Any: break;
    }
    ReplayRequest request;
    request.integrator = integrator;
    request.sampler = status.sampler;
    request.seed = status.seed;
    request.pixel = pixel;
    request.first_pass = uint32_t(integer(body, "pass", 0, INT32_MAX, 0));
    request.passes = uint32_t(integer(body, "passes", 1, 100000, 16));
    request.splats = body.value("splats", json(false)) == json(true);
    request.most_paths = most;
    later(done, [scene, request] { return Reply::json(dump(to_json(replay(*scene, request)))); });
}

}  // namespace etendue
