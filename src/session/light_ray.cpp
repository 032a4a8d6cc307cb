#include "session/light_ray.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "math/frame.h"
#include "mcmc/user_paths.h"
#include "pathspace/vertex.h"

namespace etendue {
namespace {

RayPoint describe(const Scene& scene, const SurfaceHit& hit, Vec3 toward_origin,
                  TransportMode mode) {
    const SceneShape& shape = *hit.shape;
    RayPoint point{.p = hit.geometry.p,
                   .ng = hit.geometry.ng,
                   .slack = hit.geometry.slack,
                   .shape = shape.name.empty() ? fmt::format("shape {}", hit.location.shape)
                                               : shape.name,
                   .emits = shape.emitter != nullptr,
                   .is_specular = false,
                   .events = {}};
    ComponentArena arena;
    Vertex v;
    v.set_surface(shape, hit.location, scene.surface(hit.location), toward_origin, arena);
    constexpr int kMostEvents = 16;
    for (int event = 0; event < kMostEvents; ++event) {
        const auto s = v.bsdf.sample_delta(toward_origin, uint8_t(event), mode);
        if (!s || s->weight.is_zero()) continue;
        point.events.push_back({s->event, s->wi, luminance(s->weight) * s->pdf});
    }
    point.is_specular = !v.is_connectible && !point.events.empty();
    return point;
}

/// No point also for a ray that is not one, as from a point toward itself.
std::optional<RayPoint> next_point(const Scene& scene, Vec3 o, Vec3 d, TransportMode mode) {
    if (!is_finite(o) || !is_finite(d)) return {};
    SurfaceHit hit;
    if (!scene.intersect({o, d, kInf}, 0.5f, hit)) return {};
    return describe(scene, hit, -d, mode);
}

std::vector<RayPoint> trace(const Scene& scene, Vec3 o, Vec3 d, int most, TransportMode mode) {
    std::vector<RayPoint> points;
    while (int(points.size()) < most) {
        std::optional<RayPoint> point = next_point(scene, o, d, mode);
        if (!point) break;
        points.push_back(std::move(*point));
        const RayPoint& at = points.back();
        if (!at.is_specular) break;
        d = std::max_element(at.events.begin(), at.events.end(), [](const auto& a, const auto& b) {
                return a.weight < b.weight;
            })->direction;
        o = offset_origin({at.p, at.ng, at.slack}, d);
    }
    return points;
}

/// Finds the direction in which light must leave a point to reach another one by given specular events.
class SpecularChain {
public:
    SpecularChain(const Scene& scene, std::span<const Vec3> given) : scene_(scene), given_(given) {
        const float size = size_around(scene, given), rounding = rounding_of(given);
        near_ = std::max(kNear * size, rounding);
        start_ = std::max(kStart * size, rounding);
        close_ = kClose * size;
        tolerance_ = std::max(kTolerance * size, rounding);
    }

    /// The surface met between two given points near the second one.
    std::optional<RayPoint> point_near(size_t i) const {
        const Vec3 d = normalize(given_[i] - given_[i - 1]);
        std::optional<RayPoint> point =
            next_point(scene_, given_[i - 1] + d * start_, d, TransportMode::Importance);
        if (point && length(point->p - given_[i]) > near_) point.reset();
        return point;
    }

    /// Points first … last are specular, their neighbours are not.
    Snapped solve(size_t first, size_t last) {
        first_ = first, last_ = last;
        Snapped result{{given_.begin(), given_.end()}, {}};
        const Vec3 axis = normalize(given_[first] - given_[first - 1]);
        const Frame frame = Frame::from_normal(axis);
        Vec2 at{0, 0};
        const auto shoot = [&](Vec2 u) {
            return trace(normalize(axis + frame.s * u.x + frame.t * u.y));
        };
        if (!choose_events(axis)) {
            result.problem = "the light does not meet these surfaces one after the other";
            return result;
        }
        std::optional<Arrival> best = shoot(at);
        constexpr int kSteps = 20;
        for (int step = 0; step < kSteps && best && !is_close(*best); ++step) {
            constexpr float kDelta = 1e-3f;
            const auto right = shoot({at.x + kDelta, at.y}), left = shoot({at.x - kDelta, at.y}),
                       above = shoot({at.x, at.y + kDelta}), below = shoot({at.x, at.y - kDelta});
            if (!right || !left || !above || !below) break;
            const Vec2 du{(right->miss.x - left->miss.x) / (2 * kDelta),
                          (right->miss.y - left->miss.y) / (2 * kDelta)};
            const Vec2 dv{(above->miss.x - below->miss.x) / (2 * kDelta),
                          (above->miss.y - below->miss.y) / (2 * kDelta)};
            const float det = du.x * dv.y - dv.x * du.y;
            if (!(std::abs(det) > 0)) break;
            const Vec2 move{-(best->miss.x * dv.y - dv.x * best->miss.y) / det,
                            -(du.x * best->miss.y - best->miss.x * du.y) / det};
            if (!advance(shoot, move, at, best)) break;
        }
        if (!best || !(best->distance() <= tolerance_)) {
            result.problem = "no points of these surfaces join the two ends";
            return result;
        }
        std::copy(best->points.begin(), best->points.end(), result.points.begin() + long(first));
        return result;
    }

private:
    /// Distances, relative to size_around().
    static constexpr float kNear = 2e-2f, kStart = 1e-4f, kClose = 1e-7f, kTolerance = 2e-5f;

    struct Arrival {
        std::vector<Vec3> points;
        Vec2 miss;  ///< By which the last ray passes the end, in a plane through it.

        float distance() const { return std::hypot(miss.x, miss.y); }
    };

    bool is_close(const Arrival& a) const { return a.distance() <= close_; }

    template <class Shoot>
    static bool advance(const Shoot& shoot, Vec2 move, Vec2& at, std::optional<Arrival>& best) {
        constexpr int kHalvings = 8;
        for (int halvings = 0; halvings < kHalvings; ++halvings) {
            const float f = std::ldexp(1.0f, -halvings);
            const Vec2 next{at.x + f * move.x, at.y + f * move.y};
            if (auto arrival = shoot(next); arrival && arrival->distance() < best->distance()) {
                at = next;
                best = std::move(arrival);
                return true;
            }
        }
        return false;
    }

    /// Chooses at every surface the event that leads nearest to the next given point.
    bool choose_events(Vec3 d) {
        Vec3 o = given_[first_ - 1] + d * start_;
        for (size_t i = first_; i <= last_; ++i) {
            const auto point = next_point(scene_, o, d, TransportMode::Importance);
            if (!point || !point->is_specular) return false;
            const Vec3 wanted = normalize(given_[i + 1] - point->p);
            const auto event = std::max_element(
                point->events.begin(), point->events.end(), [&](const auto& a, const auto& b) {
                    return dot(a.direction, wanted) < dot(b.direction, wanted);
                });
            events_.push_back(event->number);
            // The next surface is found where it is expected.
            d = i == last_ ? event->direction : wanted;
            o = offset_origin({point->p, point->ng, point->slack}, d);
        }
        const Vec3 last = normalize(given_[last_ + 1] - given_[last_]);
        plane_ = Frame::from_normal(last);
        return true;
    }

    std::optional<Arrival> trace(Vec3 d) const {
        Arrival arrival;
        Vec3 o = given_[first_ - 1] + d * start_, p;
        for (const uint8_t number : events_) {
            const auto point = next_point(scene_, o, d, TransportMode::Importance);
            if (!point) return {};
            const auto event = std::find_if(point->events.begin(), point->events.end(),
                                            [&](const auto& e) { return e.number == number; });
            if (event == point->events.end()) return {};
            arrival.points.push_back(point->p);
            p = point->p;
            d = event->direction;
            o = offset_origin({p, point->ng, point->slack}, d);
        }
        const Vec3 end = given_[last_ + 1];
        const float along = dot(d, plane_.n);
        if (!(along > 0)) return {};
        const Vec3 miss = p + d * (dot(end - p, plane_.n) / along) - end;
        arrival.miss = {dot(miss, plane_.s), dot(miss, plane_.t)};
        return arrival;
    }

    const Scene& scene_;
    std::span<const Vec3> given_;
    float near_;       ///< How far from a given point its surface may be met.
    float start_;      ///< Between a given point and the ray that starts there.
    float close_;      ///< A miss that needs no further step.
    float tolerance_;  ///< The largest miss.
    size_t first_ = 0, last_ = 0;
    std::vector<uint8_t> events_;
    Frame plane_;
};

}  // namespace

std::vector<RayPoint> trace_light(const Scene& scene, Vec3 origin, Vec3 direction, int most) {
    return trace(scene, origin, direction, most, TransportMode::Importance);
}

std::vector<RayPoint> trace_eye(const Scene& scene, Vec2 film, int most) {
    const SensorRay ray = scene.sensor().sample_ray(film, {0.5f, 0.5f});
    return trace(scene, ray.p, ray.d, most, TransportMode::Radiance);
}

Snapped snap(const Scene& scene, std::span<const Vec3> points, size_t index) {
    const auto none = [&](const char* problem) {
        return Snapped{{points.begin(), points.end()}, problem};
    };
    if (points.size() < 3 || index == 0 || index + 1 >= points.size())
        return none("only points between two others can be moved");
    SpecularChain chain(scene, points);
    const auto is_specular = [&](size_t i) {
        if (i == 0 || i + 1 >= points.size()) return false;
        const auto point = chain.point_near(i);
        return point && point->is_specular;
    };
    if (!is_specular(index)) return none("the point is not on a mirror or clear glass");
    size_t first = index, last = index;
    while (is_specular(first - 1)) --first;
    while (is_specular(last + 1)) ++last;
    return chain.solve(first, last);
}

}  // namespace etendue
