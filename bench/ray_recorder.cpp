#include "ray_recorder.h"

#include <chrono>
#include <stdexcept>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#if defined(__x86_64__)
#include <x86intrin.h>
#endif

// The last arguments of rtcIntersect1 and rtcOccluded1 changed places and types between Embree 3
// and 4.
extern "C" {
#if RTC_VERSION_MAJOR >= 4
void __real_rtcIntersect1(RTCScene, RTCRayHit*, RTCIntersectArguments*);
void __real_rtcOccluded1(RTCScene, RTCRay*, RTCOccludedArguments*);
void __wrap_rtcIntersect1(RTCScene, RTCRayHit*, RTCIntersectArguments*);
void __wrap_rtcOccluded1(RTCScene, RTCRay*, RTCOccludedArguments*);
#else
void __real_rtcIntersect1(RTCScene, RTCIntersectContext*, RTCRayHit*);
void __real_rtcOccluded1(RTCScene, RTCIntersectContext*, RTCRay*);
void __wrap_rtcIntersect1(RTCScene, RTCIntersectContext*, RTCRayHit*);
void __wrap_rtcOccluded1(RTCScene, RTCIntersectContext*, RTCRay*);
#endif
}

namespace etendue::bench {
namespace {

enum class Mode { Pass, Record, Time };

/// Global because the wrapped functions have no argument for it; changed only while nothing is
/// traced.
struct {
    Mode mode = Mode::Pass;
    RTCScene scene = nullptr;
    std::vector<RecordedRay>* rays = nullptr;
    uint64_t calls = 0, ticks = 0;
} between;

/// Sets the mode for the time of a call.
void run_in_mode(Mode mode, const std::function<void()>& trace) {
    between.mode = mode;
    trace();
    between.mode = Mode::Pass;
}

/// `call` hands the ray on to Embree.
template <class Call>
void pass_on(RTCScene scene, const RTCRay& ray, bool occlusion, const Call& call) {
    if (between.mode == Mode::Pass) [[likely]] {
        call();
    } else if (between.mode == Mode::Record) {
        between.scene = scene;
        between.rays->push_back(
            {{{ray.org_x, ray.org_y, ray.org_z}, {ray.dir_x, ray.dir_y, ray.dir_z}, ray.tfar},
             occlusion});
        call();
    } else {
        const uint64_t begin = ticks();
        call();
        between.ticks += ticks() - begin;
        ++between.calls;
    }
}

RTCRay to_embree(const Ray& r) {
    return {r.o.x, r.o.y, r.o.z, 0, r.d.x, r.d.y, r.d.z, 0, r.tmax, 0xffffffffu, 0, 0};
}

/// Mean ticks between two readings of the clock with nothing between them.
double ticks_of_reading() {
    constexpr int kReadings = 1 << 16;
    uint64_t sum = 0;
    for (int i = 0; i < kReadings; ++i) {
        const uint64_t begin = ticks();
        sum += ticks() - begin;
    }
    return double(sum) / kReadings;
}

}  // namespace

uint64_t ticks() {
#if defined(__x86_64__)
    // All previous instructions are finished, and no later one has started.
    _mm_lfence();
    const uint64_t now = __rdtsc();
    _mm_lfence();
    return now;
#else
    return uint64_t(std::chrono::steady_clock::now().time_since_epoch().count());
#endif
}

RecordedRays::RecordedRays(const std::function<void()>& trace) {
    between.rays = &rays_;
    run_in_mode(Mode::Record, trace);
    between.rays = nullptr;
    scene_ = between.scene;
    if (rays_.empty()) throw std::runtime_error("no rays were traced");
}

void RecordedRays::trace_range(size_t begin, size_t end) const {
    const auto scene = static_cast<RTCScene>(scene_);
    // The filter functions of masked shapes write behind the context.
    struct {
#if RTC_VERSION_MAJOR >= 4
        RTCRayQueryContext context;
#else
        RTCIntersectContext context;
#endif
        bool meets_passable = false;
    } query;
#if RTC_VERSION_MAJOR >= 4
    rtcInitRayQueryContext(&query.context);
    RTCOccludedArguments arguments;
    rtcInitOccludedArguments(&arguments);
    arguments.context = &query.context;
#else
    rtcInitIntersectContext(&query.context);
#endif
    for (size_t i = begin; i < end; ++i) {
        if (rays_[i].occlusion) {
            RTCRay ray = to_embree(rays_[i].ray);
#if RTC_VERSION_MAJOR >= 4
            __real_rtcOccluded1(scene, &ray, &arguments);
#else
            __real_rtcOccluded1(scene, &query.context, &ray);
#endif
        } else {
            RTCRayHit hit;
            hit.ray = to_embree(rays_[i].ray);
            hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
            hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if RTC_VERSION_MAJOR >= 4
            __real_rtcIntersect1(scene, &hit, nullptr);
#else
            __real_rtcIntersect1(scene, &query.context, &hit);
#endif
        }
    }
}

double RecordedRays::replay(int threads, double seconds) const {
    constexpr size_t kChunk = 4096;
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
    tbb::task_arena arena(threads);
    using Clock = std::chrono::steady_clock;
    const auto begin = Clock::now();
    double traced = 0, elapsed = 0;
    do {
        arena.execute([&] {
            tbb::parallel_for(tbb::blocked_range<size_t>(0, rays_.size(), kChunk),
                              [&](const auto& range) { trace_range(range.begin(), range.end()); });
        });
        traced += double(rays_.size());
        elapsed = std::chrono::duration<double>(Clock::now() - begin).count();
    } while (elapsed < seconds);
    return traced / elapsed;
}

double ticks_within_embree(const std::function<void()>& trace) {
    const double overhead = ticks_of_reading();
    between.ticks = between.calls = 0;
    run_in_mode(Mode::Time, trace);
    return double(between.ticks) - overhead * double(between.calls);
}

}  // namespace etendue::bench

// The names are ld's for --wrap.
#if RTC_VERSION_MAJOR >= 4
void __wrap_rtcIntersect1(RTCScene scene, RTCRayHit* hit, RTCIntersectArguments* args) {
    etendue::bench::pass_on(scene, hit->ray, false,
                            [&] { __real_rtcIntersect1(scene, hit, args); });
}
void __wrap_rtcOccluded1(RTCScene scene, RTCRay* ray, RTCOccludedArguments* args) {
    etendue::bench::pass_on(scene, *ray, true, [&] { __real_rtcOccluded1(scene, ray, args); });
}
#else
void __wrap_rtcIntersect1(RTCScene scene, RTCIntersectContext* context, RTCRayHit* hit) {
    etendue::bench::pass_on(scene, hit->ray, false,
                            [&] { __real_rtcIntersect1(scene, context, hit); });
}
void __wrap_rtcOccluded1(RTCScene scene, RTCIntersectContext* context, RTCRay* ray) {
    etendue::bench::pass_on(scene, *ray, true, [&] { __real_rtcOccluded1(scene, context, ray); });
}
#endif
