#include "mcmc/user_paths.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "description/json_text.h"
#include "description/source_location.h"
#include "math/warp.h"
#include "mcmc/addresses.h"
#include "readers/file_bytes.h"

namespace etendue {

namespace {

/// Infinite where all points are one.
float extent_of(std::span<const Vec3> points) {
    float extent = 0;
    for (const Vec3& p : points) extent = std::max(extent, length(p - points[0]));
    return extent > 0 ? extent : kInf;
}

float radius_of(const Scene& scene) {
    return scene.bounds().is_empty() ? 1 : scene.bounds().radius();
}

}  // namespace

float size_around(const Scene& scene, std::span<const Vec3> points) {
    constexpr float kMost = 3;
    return std::min(radius_of(scene), kMost * extent_of(points));
}

float rounding_of(std::span<const Vec3> points) {
    constexpr float kUlps = 8 * std::numeric_limits<float>::epsilon();
    float most = 0;
    for (const Vec3& p : points) most = std::max(most, largest_coordinate(p));
    return kUlps * most;
}

namespace {

using nlohmann::json;

[[noreturn]] void refuse(const std::string& file, const std::string& message) {
    throw std::runtime_error(fmt::format("{}: {}", file, message));
}

float positive_number(const json& value, const std::string& file, const std::string& what,
                      float most) {
    // As a float: numbers may be too small or too large for one.
    const float v = value.is_number() ? value.get<float>() : 0.0f;
    if (!(v > 0 && v <= most))
        refuse(file, fmt::format("{} must be a number above 0, at most {:g}, but is {}", what, most,
                                 excerpt(value)));
    return v;
}

GivenPath parse_path(const json& from, const std::string& file, size_t index) {
    constexpr float kWidestCone = 90;
    const std::string where = fmt::format("path {}", index + 1);
    if (!from.is_object()) refuse(file, where + " must be an object with \"points\"");
    GivenPath path;
    for (const auto& [key, value] : from.items()) {
        if (key == "name") {
            if (!value.is_string()) refuse(file, where + ": \"name\" must be a string");
            path.name = value.get<std::string>();
        } else if (key == "points") {
            if (!value.is_array()) refuse(file, where + ": \"points\" must be a list of [x, y, z]");
            for (const json& p : value) {
                const bool is_point = p.is_array() && p.size() == 3 && p[0].is_number() &&
                                      p[1].is_number() && p[2].is_number();
                if (!is_point)
                    refuse(file, fmt::format("{}: point {} must be [x, y, z], but is {}", where,
                                             path.points.size() + 1, excerpt(p)));
                const Vec3 point{p[0].get<float>(), p[1].get<float>(), p[2].get<float>()};
                if (!is_finite(point))
                    refuse(file, fmt::format("{}: point {} is {}, which is beyond single precision",
                                             where, path.points.size() + 1, excerpt(p)));
                for (int axis = 0; axis < 3; ++axis)
                    if (!(std::abs(point[axis]) <= GivenPath::kFarthest))
                        refuse(file, fmt::format("{}: point {} is {}, but coordinates must not "
                                                 "exceed {:g}",
                                                 where, path.points.size() + 1, excerpt(p),
                                                 GivenPath::kFarthest));
                path.points.push_back(point);
            }
        } else if (key == "cone") {
            const std::string what = where + ": \"cone\" (degrees)";
            if (value.is_array())
                for (const json& v : value)
                    path.cones.push_back(positive_number(v, file, what, kWidestCone));
            else
                path.cones = {positive_number(value, file, what, kWidestCone)};
        } else if (key == "radius") {
            path.radius =
                positive_number(value, file, where + ": \"radius\"", GivenPath::kFarthest);
        } else {
            refuse(file,
                   fmt::format("{} has \"{}\", but only name, points, cone and radius are known",
                               where, key));
        }
    }
    const size_t segments = path.points.size() - 1;
    if (path.points.size() < 2) refuse(file, where + " needs at least two points");
    if (path.cones.empty()) path.cones = {GivenPath::kCone};
    if (path.cones.size() != 1 && path.cones.size() != segments)
        refuse(file, fmt::format("{}: \"cone\" has {} angles for {} segments; give one for all, or "
                                 "one for each",
                                 where, path.cones.size(), segments));
    return path;
}

}  // namespace

std::vector<GivenPath> parse_user_paths(const std::string& text, const std::string& file) {
    json document;
    try {
        document = parse_json(text, file);
    } catch (const SceneError& e) {
        throw SceneError(e.where(),
                         e.message() + "; expected a list of paths, like [{\"points\": [[0, 1, 0], "
                                       "[0, 0, 0]]}]");
    }
    if (!document.is_array()) refuse(file, "must be a list of paths, [{\"points\": …}, …]");
    std::vector<GivenPath> paths;
    for (const json& p : document) paths.push_back(parse_path(p, file, paths.size()));
    return paths;
}

std::vector<GivenPath> read_user_paths(const std::string& file) {
    return read_in_memory(file, [&] { return parse_user_paths(read_file_bytes(file), file); });
}

std::string to_json(std::span<const GivenPath> paths) {
    // The shortest number that is read as the same float.
    const auto number = [](float v) { return std::stod(fmt::format("{}", v)); };
    json list = json::array();
    for (const GivenPath& path : paths) {
        json points = json::array();
        for (const Vec3 p : path.points) points.push_back({number(p.x), number(p.y), number(p.z)});
        json item{{"points", std::move(points)}};
        if (!path.name.empty()) item["name"] = path.name;
        if (path.cones.size() == 1)
            item["cone"] = number(path.cones[0]);
        else if (!path.cones.empty())
            item["cone"] = path.cones;
        if (path.radius) item["radius"] = number(*path.radius);
        list.push_back(std::move(item));
    }
    return list.dump(1) + "\n";
}

// -- Checks.

namespace {

/// Largest distance of a point from its surface, relative to the radius of the scene's bounds, and to the path's extent: a
/// point that is moved so far stays within the default cone about a segment as long as the path.
constexpr float kTolerance = 1e-3f, kToleranceOfExtent = 1e-2f;
/// Default radius of the disc on an emitter, relative to size_around().
constexpr float kDisc = 1e-2f;
/// Largest deviation from the reflected or refracted direction, in degrees.
constexpr double kLawTolerance = 2;

double degrees(Vec3 a, Vec3 b) {
    return 2 * std::asin(std::min(1.0, double(length(a - b)) / 2)) * 180 / std::numbers::pi;
}

std::string name_of(const Scene& scene, const SceneShape& shape) {
    return shape.name.empty() ? fmt::format("shape {}", &shape - scene.shapes().data())
                              : fmt::format("\"{}\"", shape.name);
}

std::string to_text(Vec3 p) {
    return fmt::format("({:.5g}, {:.5g}, {:.5g})", p.x, p.y, p.z);
}

/// Approximately the surface point nearest to `p`.
struct Nearest {
    SurfaceHit hit;
    float distance = kInf;
};
Nearest nearest_surface(const Scene& scene, Vec3 p, float tolerance) {
    constexpr int kDirections = 512;
    Nearest best;
    const auto try_direction = [&](Vec3 d) {
        // The ray starts before the point, so that it hits a surface that contains the point.
        SurfaceHit hit;
        if (!scene.intersect({p - d * (tolerance / 2), d, kInf}, 0, hit)) return;
        const float distance = length(hit.geometry.p - p);
        if (distance < best.distance) best = {hit, distance};
    };
    for (int i = 0; i < kDirections; ++i) {
        constexpr float kGolden = 0.6180339887f;
        const float turns = kGolden * float(i);
        try_direction(sample_uniform_sphere(
            {(float(i) + 0.5f) / float(kDirections), turns - std::floor(turns)}));
    }
    if (!std::isfinite(best.distance)) return best;
    const Vec3 n = best.hit.geometry.ng;
    try_direction(n);
    try_direction(-n);
    return best;
}

class PathChecker {
public:
    PathChecker(const Scene& scene, const GivenPath& given) : scene_(scene), given_(given) {
        const float rounding = rounding_of(given.points);
        tolerance_ = std::max(rounding, std::min(kTolerance * radius_of(scene),
                                                 kToleranceOfExtent * extent_of(given.points)));
        path_.radius =
            given.radius.value_or(std::max(rounding, kDisc * size_around(scene, given.points)));
    }

    CheckedPath check() {
        for (size_t i = 0; i < given_.points.size() && problem_.empty(); ++i) place(i);
        for (size_t i = 0; i + 1 < given_.points.size() && problem_.empty(); ++i) check_edge(i);
        for (size_t i = 0; i < given_.points.size() && problem_.empty(); ++i) check_scattering(i);
        if (!problem_.empty()) return {{}, point_, problem_};
        return {std::move(path_), 0, {}};
    }

private:
    void refuse(size_t point, std::string problem) {
        point_ = int(point);
        problem_ = std::move(problem);
    }

    /// Moves the point to the nearest surface, or to a point emitter.
    void place(size_t i) {
        const Vec3 p = given_.points[i];
        UserPath::Point& point = path_.points.emplace_back();
        const float cone =
            given_.cones[given_.cones.size() == 1 ? 0 : std::min(i, given_.cones.size() - 1)];
        point.versine = 2 * sqr(std::sin(cone * kPi / 360));
        if (i == 0 && place_on_point_emitter(p)) return;
        const Nearest at = nearest_surface(scene_, p, tolerance_);
        if (!std::isfinite(at.distance)) return refuse(i, "there is no surface near it");
        const SceneShape& shape = *at.hit.shape;
        if (at.distance > tolerance_)
            return refuse(i,
                          fmt::format("is {:.3g} from the nearest surface, {}; at most {:.3g} is "
                                      "allowed",
                                      at.distance, name_of(scene_, shape), tolerance_));
        const SurfaceGeometry& g = at.hit.geometry;
        point.p = g.p, point.ng = g.ng;
        shapes_.push_back(&shape);
        locations_.push_back(at.hit.location);
        if (i > 0) return;
        if (!shape.emitter)
            return refuse(0, fmt::format("is on {}, which emits nothing", name_of(scene_, shape)));
        path_.emitter = shape.emitter;
        path_.uv = {at.hit.location.u, at.hit.location.v};
        path_.prim = at.hit.location.prim;
    }

    bool place_on_point_emitter(Vec3 p) {
        for (const auto& e : scene_.emitters()) {
            if (!e->is_delta() || e->is_infinite()) continue;
            const EmissionSample at = e->sample_emission({0.5, 0.5}, {0.5f, 0.5f});
            if (length(at.p - p) > tolerance_) continue;
            path_.points[0].p = at.p, path_.points[0].ng = at.ng;
            path_.emitter = e.get();
            shapes_.push_back(nullptr);
            locations_.push_back({});
            return true;
        }
        return false;
    }

    void check_edge(size_t i) {
        const UserPath::Point &a = path_.points[i], &b = path_.points[i + 1];
        const float distance = length(b.p - a.p);
        if (!(distance > 0)) return refuse(i + 1, "is the same as the point before it");
        const Vec3 d = (b.p - a.p) * (1 / distance);
        SurfaceHit hit;
        const Vec3 o =
            shapes_[i] ? offset_origin({a.p, a.ng, scene_.surface(locations_[i]).slack}, d) : a.p;
        if (!scene_.intersect({o, d, kInf}, 0.5f, hit) || hit.t > distance - tolerance_) return;
        refuse(i + 1,
               fmt::format("cannot be reached from the point before it: {} at {} is in the way",
                           name_of(scene_, *hit.shape), to_text(hit.geometry.p)));
    }

    Vec3 toward(size_t from, size_t to) const {
        return normalize(path_.points[to].p - path_.points[from].p);
    }

    void check_scattering(size_t i) {
        UserPath::Point& point = path_.points[i];
        const bool is_last = i + 1 == path_.points.size();
        if (i == 0) {
            if (path_.emitter->eval_emission(point.ng, path_.uv, path_.prim, toward(0, 1))
                    .Le_cos.is_zero())
                refuse(0, "its emitter emits nothing toward the next point");
            return;
        }
        const SceneShape& shape = *shapes_[i];
        const Vec3 to_light = toward(i, i - 1);
        ComponentArena arena;
        Vertex v;
        v.set_surface(shape, locations_[i], scene_.surface(locations_[i]), to_light, arena);
        if (is_last) {
            if (!v.is_connectible)
                refuse(i,
                       fmt::format("is on {}, a mirror or clear glass; a path must end where light "
                                   "scatters in all directions",
                                   name_of(scene_, shape)));
            return;
        }
        const Vec3 to_eye = toward(i, i + 1);
        if (!v.bsdf.eval(to_light, to_eye, TransportMode::Importance).f.is_zero()) return;
        double nearest = 360;
        for (int event = 0; event < 16; ++event) {
            const auto s = v.bsdf.sample_delta(to_light, uint8_t(event), TransportMode::Importance);
            if (!s || s->weight.is_zero() || !(degrees(s->wi, to_eye) < nearest)) continue;
            nearest = degrees(s->wi, to_eye);
            point.is_delta = true;
            point.event = s->event;
        }
        if (!point.is_delta)
            refuse(i,
                   fmt::format("{} scatters nothing from the point before it to the point after it",
                               name_of(scene_, shape)));
        else if (nearest > kLawTolerance)
            refuse(i, fmt::format(
                          "on {}, the path is {:.3g} degrees off the law of {}; at most {} are "
                          "allowed",
                          name_of(scene_, shape), nearest,
                          point.event % 2 == 1 ? "refraction" : "reflection", kLawTolerance));
    }

    const Scene& scene_;
    const GivenPath& given_;
    float tolerance_;
    UserPath path_;
    std::vector<const SceneShape*> shapes_;  ///< By point; nullptr for a point emitter.
    std::vector<SurfaceLocation> locations_;
    int point_ = 0;
    std::string problem_;
};

}  // namespace

CheckedPath check_user_path(const Scene& scene, const GivenPath& given) {
    return PathChecker(scene, given).check();
}

std::string to_string(const CheckedPath& refused, const GivenPath& given, size_t index,
                      const std::string& file) {
    return fmt::format("{}: path {}{}, point {}: {}", file, index + 1,
                       given.name.empty() ? "" : fmt::format(" \"{}\"", given.name),
                       refused.point + 1, refused.problem);
}

// -- Proposals.

UserPaths UserPaths::load(const Scene& scene, const std::string& file) {
    const std::vector<GivenPath> given = read_user_paths(file);
    if (given.empty()) refuse(file, "has no paths");
    std::vector<UserPath> paths;
    std::string problems;
    for (size_t i = 0; i < given.size(); ++i) {
        CheckedPath checked = check_user_path(scene, given[i]);
        if (checked.path)
            paths.push_back(std::move(*checked.path));
        else
            problems += (problems.empty() ? "" : "\n") + to_string(checked, given[i], i, file);
    }
    if (!problems.empty()) throw std::runtime_error(problems);
    return {scene, std::move(paths)};
}

namespace {

Vec3 sample_cone(Vec3 axis, float versine, Vec2 u) {
    return normalize(Frame::from_normal(axis).to_world(sample_uniform_cone(u, versine)));
}

}  // namespace

bool UserPaths::find_on_emitter(const UserPath& path, Vec3 q, SurfaceHit& hit) const {
    const Vec3 n = path.points[0].ng;
    return scene_->intersect({q + n * path.radius, -n, 2 * path.radius}, 0, hit) &&
           hit.shape->emitter == path.emitter;
}

int UserPaths::longest() const {
    size_t most = 0;
    for (const UserPath& path : paths_) most = std::max(most, path.points.size());
    return int(most);
}

bool UserPaths::sample(const WalkContext& walk, Sampler& sampler, SubPath& y) const {
    y.clear();
    sampler.seek(Stream::Selection, addresses::kUserPath);
    const auto i = std::min(size_t(sampler.next_1d() * float(paths_.size())), paths_.size() - 1);
    const UserPath& path = paths_[i];
    const Emitter& emitter = *path.emitter;
    const std::vector<UserPath::Point>& points = path.points;
    EmissionSample e{.p = points[0].p,
                     .ng = points[0].ng,
                     .d = {},
                     .Le = {},
                     .pdf_y0 = 1,
                     .pdf_d = 0,
                     .uv = path.uv,
                     .prim = path.prim};
    // As for traced paths, each vertex has its own numbers, even if it reads only that of a mask.
    sampler.seek(Stream::Light, 0);
    const Vec2 u = sampler.next_2d();
    if (emitter.is_area()) {
        const Vec2 disc = sample_uniform_disk(u) * path.radius;
        const Frame frame = Frame::from_normal(points[0].ng);
        SurfaceHit hit;
        if (!find_on_emitter(path, points[0].p + frame.s * disc.x + frame.t * disc.y, hit))
            return false;
        e.p = hit.geometry.p, e.ng = hit.geometry.ng;
        e.uv = {hit.location.u, hit.location.v};
        e.prim = hit.location.prim;
    }
    e.d = sample_cone(normalize(points[1].p - e.p), points[0].versine, sampler.next_2d());
    if (!emitter.is_area()) e.ng = e.d;
    const Emitter::Emission emission = emitter.eval_emission(e.ng, e.uv, e.prim, e.d);
    e.Le = emission.Le_cos, e.pdf_d = emission.pdf_d;
    if (emitter.is_area()) {
        e.Le *= 1 / abs_dot(e.ng, e.d);
        e.pdf_y0 = emitter.eval_surface(e.ng, e.uv, e.prim, e.d).pdf_y0;
    }
    if (!(e.pdf_y0 > 0)) return false;
    start_light_path(walk, emitter, e, sampler, y);
    if (y.size() != 2) return false;
    // Rounding puts a few vertices outside of the cones, where density() is zero: such paths end there. With the density
    // of the other ways to sample them alone, their weights would be far too large.
    if (!(start_density(path, y[0]) > 0) || !(step_density(path, 0, y[0], y[1]) > 0)) {
        y.clear();
        return false;
    }
    for (size_t j = 1; j + 1 < points.size(); ++j) {
        const Vertex& v = y[int(j)];
        std::optional<BsdfSample> s;
        sampler.seek(Stream::Light, j);
        if (points[j].is_delta) {
            s = v.bsdf.sample_delta(v.wo, points[j].event, TransportMode::Importance);
        } else if (v.is_connectible) {
            const Vec3 w =
                sample_cone(normalize(points[j + 1].p - v.p), points[j].versine, sampler.next_2d());
            const BsdfEval f = v.eval_unguided(w, TransportMode::Importance);
            if (f.pdf > 0)
                s = BsdfSample{.wi = w,
                               .weight = f.f * (1 / f.pdf),
                               .pdf = f.pdf,
                               .pdf_rev = f.pdf_rev,
                               .eta = f.eta};
        }
        if (!s || !append<TransportMode::Importance>(walk, sampler, *s, y)) return false;
        if (!(step_density(path, int(j), y[int(j)], y[int(j) + 1]) > 0)) {
            y.truncate(int(j) + 1);
            return false;
        }
    }
    return true;
}

double UserPaths::start_density(const UserPath& path, const Vertex& y0) const {
    constexpr float kSame = 1e-3f;  // Of the disc's radius.
    if (y0.emitter != path.emitter) return 0;
    if (!path.emitter->is_area()) return 1;
    const Vec3 n = path.points[0].ng, to = y0.p - path.points[0].p;
    const Vec3 q = y0.p - n * dot(to, n);
    SurfaceHit hit;
    if (length2(q - path.points[0].p) > sqr(path.radius) || !find_on_emitter(path, q, hit) ||
        length2(hit.geometry.p - y0.p) >
            sqr(std::max(kSame * path.radius, rounding_of({&y0.p, 1}))))
        return 0;
    return double(abs_dot(n, y0.ng)) / (std::numbers::pi * sqr(double(path.radius)));
}

double UserPaths::step_density(const UserPath& path, int j, const Vertex& from, const Vertex& to) {
    const UserPath::Point& point = path.points[size_t(j)];
    const bool is_delta = j > 0 && from.is_delta;
    if (is_delta != point.is_delta || (is_delta && from.event != point.event)) return 0;
    const double p = double(to_area(1, from, to));
    if (is_delta) return p;
    const Vec3 axis = normalize(path.points[size_t(j) + 1].p - from.p);
    if (length2(direction(from, to) - axis) > 2 * point.versine) return 0;
    return p * double(pdf_uniform_cone(point.versine));
}

PathDensity UserPaths::density(std::span<const Vertex* const> y) const {
    PathDensity sum = 0;
    for (const UserPath& path : paths_) {
        if (y.size() != path.points.size()) continue;
        PathDensity p = start_density(path, *y[0]);
        for (size_t j = 0; j + 1 < y.size() && p > 0; ++j)
            p *= step_density(path, int(j), *y[j], *y[j + 1]);
        sum += p;
    }
    return sum / PathDensity(paths_.size());
}

void UserPaths::density_ratios(const SubPath& y, std::vector<double>& ratios) const {
    ratios.assign(size_t(y.size()), 0);
    if (y.size() == 0) return;
    for (const UserPath& path : paths_) {
        const int m = int(path.points.size()) - 1;
        double ratio = start_density(path, y[0]) / double(y[0].pdf_fwd);
        for (int i = 0; i < y.size() && ratio > 0; ++i) {
            if (i > 0 && i <= m)
                ratio *= step_density(path, i - 1, y[i - 1], y[i]) / double(y[i].pdf_fwd);
            ratios[size_t(i)] += ratio / double(paths_.size());
        }
    }
}

}  // namespace etendue
