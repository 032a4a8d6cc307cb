#include "studio/api.h"

#include <array>
#include <filesystem>
#include <future>

#include <fmt/format.h>

#include "math/content_hash.h"
#include "mcmc/pick_paths.h"
#include "render/aov.h"
#include "render/plugin_list.h"
#include "render/render_request.h"
#include "render/scene_integrator.h"
#include "session/file_version.h"
#include "session/light_ray.h"
#include "session/replay.h"
#include "studio/guard.h"
#include "studio/page.h"
#include "studio/reply_json.h"
#include "studio/request_values.h"
#include "system/output_file.h"

namespace etendue {
namespace {

using nlohmann::json;

struct PageFile {
    std::string_view path, type, text;
};
const std::array<PageFile, 11>& page_files() {
    constexpr std::string_view kScript = "text/javascript; charset=utf-8";
    static const std::array<PageFile, 11> files{{
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
        {"/histogram.js", kScript, kHistogramJs},
    }};
    return files;
}

/// Toward what the sensor shows above; not normalised.
Vec3 up_of(const Scene& scene) {
    const auto [width, height] = std::pair{float(scene.film().width), float(scene.film().height)};
    const SensorRay above = scene.sensor().sample_ray({width / 2, 0}, {0.5f, 0.5f}),
                    below = scene.sensor().sample_ray({width / 2, height}, {0.5f, 0.5f});
    return (above.p + above.d) - (below.p + below.d);
}

std::string hash_of(const std::string& text) {
    return fmt::format("\"{:016x}\"", ContentHash().add(text).value());
}

}  // namespace

Api::Api(Session& session, ApiOptions options)
    : session_(session), options_(std::move(options)), denoised_(session, options_.threads) {
    const std::filesystem::path folder = std::filesystem::path(options_.scene_file).parent_path();
    scene_folder_ = folder.empty() ? "." : folder.string();
    scene_file_version_ = file_version(options_.scene_file);
}

Api::~Api() {
    is_ended_ = true;
}

// -- Requests.

Admission Api::admit(const Request& request) {
    Admission a;
    a.refusal = refuse(request, options_.token, options_.hosts);
    a.has_token = !a.refusal && request.path().starts_with("/v1");
    a.is_events = !a.refusal && request.method == "GET" && request.path() == "/v1/events";
    a.brings_file = a.has_token && request.method == "POST" && request.path() == "/v1/images";
    return a;
}

void Api::handle(Request request, std::function<void(Reply)> done) try {
    if (auto refusal = admit(request).refusal) return done(std::move(*refusal));
    const std::string_view path = request.path();
    const bool is_get = request.method == "GET" || request.method == "HEAD";
    for (const PageFile& file : page_files())
        if (path == file.path) {
            if (!is_get) throw ApiError(405, "only GET is possible here");
            Reply reply;
            reply.type = file.type;
            reply.body = file.text;
            return done(std::move(reply));
        }
    // Browsers ask for it unbidden, and complain where it is missing.
    if (path == "/favicon.ico") return done(Reply::nothing());
    const auto needs = [&](bool holds) {
        if (!holds) throw ApiError(405, "this method is not possible here");
    };
    if (path == "/v1/state") return needs(is_get), done(state());
    if (path == "/v1/image") return needs(is_get), image(request, done);
    if (path == "/v1/pixel") return needs(is_get), done(pixel(request));
    if (path == "/v1/worst") return needs(is_get), worst(request, done);
    if (path == "/v1/difference") return needs(is_get), difference(request, done);
    if (path == "/v1/gain") return needs(is_get), gain(request, done);
    if (path == "/v1/techniques") return needs(is_get), done(techniques(request));
    if (path == "/v1/paths") {
        if (request.method == "PUT") return done(put_paths(request));
        return needs(is_get), done(get_paths(request));
    }
    if (path == "/v1/geometry") {
        needs(is_get);
        return later(workers_, done, [data = data()] {
            Reply reply = Reply::binary({});
            reply.shared_body = data->geometry();
            return reply;
        });
    }
    if (path == "/v1/images") return images(std::move(request), done);
    if (path == "/v1/run")
        return needs(request.method == "POST"), run(parse_object(request.body), done);
    if (path == "/v1/save")
        return needs(request.method == "POST"), save(parse_object(request.body), done);
    for (const char* known :
         {"/v1/ray", "/v1/paths/check", "/v1/paths/snap", "/v1/paths/pick", "/v1/replay"})
        if (path == known) return needs(request.method == "POST"), probe(request, done);
    throw ApiError(404, "there is nothing at this address");
} catch (const std::exception&) {
    done(Reply::current_exception());
}

void Api::later(Workers& workers, const Done& done, std::function<Reply()> task) {
    const bool is_taken = workers.post([done, task = std::move(task)] {
        Reply reply;
        try {
            reply = task();
        } catch (const std::exception&) {
            reply = Reply::current_exception();
        }
        done(std::move(reply));
    });
    if (!is_taken) throw ApiError(503, "too many requests wait; try again");
}

std::shared_ptr<const Scene> Api::scene() const {
    if (auto scene = session_.scene()) return scene;
    const std::string error = session_.load_error();
    throw ApiError(503, error.empty() ? "the scene is being loaded" : error);
}

std::shared_ptr<SceneData> Api::data() {
    const std::shared_ptr<const Scene> current = scene();
    const std::lock_guard lock(data_mutex_);
    if (!data_ || data_->scene() != current) data_ = std::make_shared<SceneData>(current);
    return data_;
}

// -- State and events.

void Api::look_at_scene_file() {
    using namespace std::chrono_literals;
    const auto now = std::chrono::steady_clock::now();
    if (now < looked_ + 2s) return;
    looked_ = now;
    const bool is_changed = file_version(options_.scene_file) != scene_file_version_;
    if (is_changed != is_scene_changed_) ++own_revision_;
    is_scene_changed_ = is_changed;
}

uint64_t Api::revision() {
    look_at_scene_file();
    return session_.revision() + own_revision_ + opened_.version() + denoised_.version();
}

std::string Api::event() {
    json runs = json::array();
    for (const RunStatus& s : session_.runs()) runs.push_back(progress_of(s));
    return dump({{"runs", runs},
                 {"scene_version", session_.scene_version()},
                 {"load_error", session_.load_error()},
                 {"scene_changed", is_scene_changed_},
                 {"kept_version", session_.kept_version()},
                 {"images_version", opened_.version()}});
}

Reply Api::state() {
    json j{{"version", 1},
           {"scene_file", std::filesystem::path(options_.scene_file).filename().string()},
           {"scene_version", session_.scene_version()},
           {"load_error", session_.load_error()},
           {"scene_changed", is_scene_changed_},
           {"most_file_bytes", kMostFileBytes},
           {"has_reference", options_.reference.has_value()},
           {"reference_problem", ""},
           {"scene", nullptr}};
    if (const std::string problem = reference_problem(); !problem.empty()) {
        j["has_reference"] = false;
        j["reference_problem"] = problem;
    }
    if (const auto scene = session_.scene()) {
        const FilmGeometry& g = scene->film();
        const bool is_empty = scene->bounds().is_empty();
        j["scene"] = {
            {"width", g.crop_width},
            {"height", g.crop_height},
            {"crop", {g.crop_x, g.crop_y}},
            {"whole", {g.width, g.height}},
            {"up", to_json(up_of(*scene))},
            {"filter_is_wide", scene->filter().is_wide()},
            {"sensors", scene->sensor_names()},
            {"sensor", scene->sensor_index()},
            {"has_own_camera", view_.camera.has_value()},
            {"shapes", scene->shapes().size()},
            {"emitters", scene->emitters().size()},
            {"center", to_json(is_empty ? Vec3() : scene->bounds().center())},
            {"radius", is_empty ? 1.0f : scene->bounds().radius()},
            {"warnings", warnings_of(*scene)},
            {"integrator", scene->defaults().integrator ? name_of_integrator(*scene) : ""}};
        const SensorRay eye =
            scene->sensor().sample_ray({float(g.width) / 2, float(g.height) / 2}, {0.5f, 0.5f});
        j["scene"]["eye"] = to_json(eye.p);
        j["scene"]["look"] = to_json(eye.d);
    }
    j["runs"] = json::array();
    for (const RunStatus& s : session_.runs()) j["runs"].push_back(to_json(s));
    j["keeps_runs"] = !session_.runs_folder().empty();
    j["kept_version"] = session_.kept_version();
    j["kept"] = json::array();
    for (const KeptRun& k : session_.kept()) j["kept"].push_back(to_json(k));
    j["images_version"] = opened_.version();
    j["images"] = json::array();
    for (const auto& [id, image] : opened_.list()) j["images"].push_back(to_json(id, *image));
    j["integrators"] =
        json::parse(etendue::to_json(choose_plugins(plugin_list(), "integrator", "")).dump());
    j["layers"] = json::array();
    for (const AovInfo& a : aov_registry())
        j["layers"].push_back({{"name", a.name}, {"doc", a.doc}});
    return Reply::json(dump(j));
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
        // An empty name stays: without it, there are those of the scene's integrator.
        if (const auto file = spec.params.find("user_paths");
            file != spec.params.end() && !file->second.empty()) {
            request.user_paths = find_file_in(folders(), file->second);
            spec.params.erase(file);
        }
        request.integrator = spec.to_string();
    }
    request.sampler =
        sampler_named(text_of(body, "sampler", to_string(request.sampler)), "\"sampler\"");
    request.filter_mode = filter_mode_named(
        text_of(body, "filter_mode", to_string(request.filter_mode)), "\"filter_mode\"");
    request.seed = uint64_t(integer(body, "seed", 0, INT64_MAX, 0));
    static_cast<RenderLimits&>(request) = limits_of(body);
    constexpr int kMostDepth = 64;
    request.technique_depth = int(integer(body, "techniques", 0, kMostDepth, 0));
    constexpr int kMostSeeds = 64;
    request.seeds = int(integer(body, "seeds", 1, kMostSeeds, 1));
    if (request.seeds > 1 && !request.spp && !request.seconds)
        throw ApiError(422, "several seeds need \"spp\" or \"seconds\" for each");
    return request;
}

/// What the body does not name stays as it is; null takes it away.
void Api::set_view(const json& body) {
    if (!options_.set_view) throw ApiError(422, "the view cannot be changed here");
    const std::shared_ptr<const Scene> scene = this->scene();
    SceneView view = view_;
    if (body.contains("sensor")) {
        const int last = int(scene->sensor_names().size()) - 1;
        view.sensor = std::to_string(integer(body, "sensor", 0, last));
        view.crop = {};
        view.camera = {};
    }
    if (body.contains("crop")) {
        view.crop = {};
        if (const json& crop = body["crop"]; !crop.is_null()) {
            const FilmGeometry& g = scene->film();
            const int x = int(integer(crop, "x", 0, g.width - 1)),
                      y = int(integer(crop, "y", 0, g.height - 1));
            view.crop = {x, y, int(integer(crop, "w", 1, g.width - x)),
                         int(integer(crop, "h", 1, g.height - y))};
        }
    }
    if (body.contains("camera")) {
        view.camera = {};
        if (const json& c = body["camera"]; !c.is_null()) {
            view.camera = {to_vec(c.value("eye", json()), "eye"),
                           to_vec(c.value("target", json()), "target"),
                           to_vec(c.value("up", json()), "up")};
            if (!Transform::look_at(view.camera->eye, view.camera->target, view.camera->up))
                throw ApiError(422, "\"eye\", \"target\" and \"up\" are no view");
        }
    }
    view_ = view;
    options_.set_view(view);
}

/// A run is opened by the name of a file in the folder of kept runs; links are not followed.
void Api::open(const json& body, const Done& done) {
    const std::string folder = session_.runs_folder(), name = text_of(body, "file");
    if (!folder.empty()) find_file_in({folder}, name);
    if (!name.ends_with(RunFolder::kExtension))
        throw ApiError(422, fmt::format("the name must end with {}", RunFolder::kExtension));
    session_.open(name, [done](const Opened& opened) {
        done(opened.error.empty() ? Reply::json(dump({{"run", opened.run}}))
                                  : Reply::error(422, opened.error));
    });
}

/// The file is then as it is loaded.
void Api::reload() {
    scene_file_version_ = file_version(options_.scene_file);
    looked_ = {};
    session_.reload();
}

void Api::run(const json& body, const Done& done) {
    const std::string action = text_of(body, "action");
    if (action == "start") {
        const int id = session_.start(run_request(body));
        return done(Reply::json(dump({{"run", id}})));
    }
    if (action == "open") return open(body, done);
    if (action == "list") {
        session_.list_kept();
        return done(Reply::json("{}"));
    }
    if (action == "reload") {
        reload();
        return done(Reply::json("{}"));
    }
    if (action == "view") {
        set_view(body);
        reload();
        return done(Reply::json("{}"));
    }
    const int id = int(integer(body, "run", 1, INT32_MAX));
    if (action == "stop")
        session_.stop(id);
    else if (action == "discard")
        session_.discard(id);
    else if (action == "continue")
        session_.resume(id, limits_of(body));
    else if (action == "remove")
        session_.remove(id), denoised_.forget(id);
    else
        throw ApiError(422, "\"action\" must be start, stop, continue, discard, remove, open, "
                            "list, view or reload");
    done(Reply::json(dump({{"run", id}})));
}

void Api::save(const json& body, const Done& done) {
    const std::string name = text_of(body, "file");
    if (!is_file_name(name))
        throw ApiError(422, fmt::format("\"{}\" is no name of a file: only letters, digits, '.', "
                                        "'_' and '-' are allowed, without a leading dot",
                                        name));
    check_image_extension(name);
    const bool replaces = boolean(body, "overwrite");
    check_writable(options_.output_folder, name, replaces);
    session_.save(int(integer(body, "run", 1, INT32_MAX)), options_.output_folder + "/" + name,
                  replaces, [done, name](const Saved& saved) {
                      done(saved.error.empty()
                               ? Reply::json(dump({{"file", name}, {"passes", saved.passes}}))
                               : Reply::error(422, saved.error));
                  });
}

// -- User paths.

/// The paths of a file as the program reads them, as JSON; none where there is no such file.
std::string Api::paths_in(const std::string& name) const {
    const std::string text = read_file_in(folders(), name).value_or("[]");
    return etendue::to_json(parse_user_paths(text, name));
}

Reply Api::get_paths(const Request& request) {
    const std::string name = request.query("file").value_or("paths.json");
    Reply reply = Reply::json(paths_in(name));
    reply.etag = hash_of(reply.body);
    return reply;
}

Reply Api::put_paths(const Request& request) {
    const std::string name = request.query("file").value_or("paths.json");
    if (!is_file_name(name)) throw ApiError(422, "this is no name of a file");
    if (!name.ends_with(".json")) throw ApiError(422, "the name must end with .json");
    Reply reply = Reply::json(etendue::to_json(paths_of(parse_body(request.body), name)));
    check_writable(options_.output_folder, name, true);
    if (std::string current = paths_in(name); request.if_match != hash_of(current)) {
        reply.status = 409;
        reply.body = std::move(current);
    } else {
        write_file(options_.output_folder + "/" + name, reply.body, Links::Replace);
        ++own_revision_;
    }
    reply.etag = hash_of(reply.body);
    return reply;
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
            return later(workers_, done, [=] {
                return Reply::json(
                    dump({{"points", to_json(trace_eye(*scene, film, kMostPoints))}}));
            });
        }
        const Vec3 origin = to_vec(body.value("origin", json()), "origin"),
                   direction = to_vec(body.value("direction", json()), "direction");
        const float largest = largest_coordinate(direction);
        if (!(largest > 0)) throw ApiError(422, "\"direction\" must not be zero");
        // The square of a small number may be zero.
        const Vec3 d =
            normalize({direction.x / largest, direction.y / largest, direction.z / largest});
        const bool follows = boolean(body, "trace");
        return later(workers_, done, [=] {
            return Reply::json(dump(
                {{"points", to_json(trace_light(*scene, origin, d, follows ? kMostPoints : 1))}}));
        });
    }
    if (path == "/v1/paths/check") {
        return later(workers_, done,
                     [scene, given = paths_of(body.value("paths", json()), "paths")] {
                         json verdicts = json::array();
                         for (const GivenPath& one : given) {
                             const CheckedPath checked = check_user_path(*scene, one);
                             if (checked.path)
                                 verdicts.push_back({{"ok", true}});
                             else
                                 verdicts.push_back({{"ok", false},
                                                     {"point", checked.point},
                                                     {"problem", checked.problem}});
                         }
                         return Reply::json(dump({{"verdicts", verdicts}}));
                     });
    }
    if (path == "/v1/paths/snap") {
        json list = json::array({json{{"points", body.value("points", json())}}});
        std::vector<GivenPath> given = paths_of(list, "points");
        const auto index = size_t(integer(body, "index", 0, 31));
        return later(workers_, done, [scene, given = std::move(given[0]), index] {
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
        return later(workers_, done, [scene, pick] {
            return Reply::json(etendue::to_json(pick_paths(*scene, pick)));
        });
    }
    replay_pixel(body, done);
}

void Api::replay_last_pass(int run, uint64_t pixel, size_t most, const Done& done) {
    session_.replay_last(run, pixel, most, [done](const Replay& paths, const std::string& error) {
        if (!error.empty()) return done(Reply::error(422, error));
        json j = to_json(paths);
        j["is_last_pass"] = true;
        done(Reply::json(dump(j)));
    });
}

template <class Answer>
Answer Api::answer_of(const std::function<void(std::function<void(const Answer&)>)>& ask) const {
    using namespace std::chrono_literals;
    const auto promise = std::make_shared<std::promise<Answer>>();
    std::future<Answer> answer = promise->get_future();
    ask([promise](const Answer& a) { promise->set_value(a); });
    while (answer.wait_for(20ms) != std::future_status::ready)
        if (is_ended_) throw ApiError(503, "the program ends");
    return answer.get();
}

Reply Api::replay_whole_pass(int run, uint32_t pass, uint64_t pixel, size_t most) {
    const auto of = answer_of<std::optional<PassOfRun>>(
        [&](auto done) { session_.ask_pass(run, pass, std::move(done)); });
    if (!of)
        return answer_of<Reply>(
            [&](auto done) { replay_last_pass(run, pixel, most, std::move(done)); });
    json j = to_json(replay_pass(*of, pixel, most, is_ended_));
    j["pass"] = pass;
    return Reply::json(dump(j));
}

void Api::replay_pixel(const json& body, const Done& done) {
    const int run = int(integer(body, "run", 1, INT32_MAX));
    const RunStatus status = session_.status(run);
    const std::shared_ptr<const Scene> scene = session_.scene_of(run);
    const FilmGeometry& g = scene->film();
    if (scene != this->scene())
        throw ApiError(409, "the run belongs to an earlier version of the scene");
    const uint64_t pixel = g.pixel_index(int(integer(body, "x", 0, g.crop_width - 1)),
                                         int(integer(body, "y", 0, g.crop_height - 1)));
    constexpr size_t kMostPaths = 10000;
    const auto most = size_t(integer(body, "most", 1, kMostPaths, 1000));
    if (!status.why_look_only.empty())
        throw ApiError(422, fmt::format("its paths cannot be traced again, since the run can only "
                                        "be looked at: {}",
                                        status.why_look_only));
    const IntegratorSpec integrator = IntegratorSpec::parse(status.request.integrator);
    switch (replayed_passes(integrator, *scene)) {
    case ReplayedPasses::None:
        throw ApiError(422, fmt::format("paths of {} cannot be traced again: they are states of "
                                        "Markov chains, or are not kept",
                                        integrator.name));
    case ReplayedPasses::Whole:
        if (!body.contains("pass")) return replay_last_pass(run, pixel, most, done);
        return later(
            workers_, done,
            [this, run, pixel, most, pass = uint32_t(integer(body, "pass", 0, INT32_MAX))] {
                return replay_whole_pass(run, pass, pixel, most);
            });
    case ReplayedPasses::Any: break;
    }
    ReplayRequest request;
    request.integrator = integrator;
    request.sampler = status.request.sampler;
    request.filter_mode = status.request.filter_mode;
    request.seed = status.request.seed;
    request.pixel = pixel;
    request.first_pass =
        uint32_t(status.request.first_pass) + uint32_t(integer(body, "pass", 0, INT32_MAX, 0));
    request.passes = uint32_t(integer(body, "passes", 1, 100000, 16));
    request.splats = boolean(body, "splats");
    request.most_paths = most;
    later(workers_, done,
          [scene, request] { return Reply::json(dump(to_json(replay(*scene, request)))); });
}

}  // namespace etendue
