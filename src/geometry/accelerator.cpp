#include "geometry/accelerator.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstddef>
#include <map>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "geometry/ray_tracer.h"
#include "system/available_memory.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace etendue {
namespace {

void bounds_callback(const RTCBoundsFunctionArguments* args) {
    const auto* shape = static_cast<const AnalyticShape*>(args->geometryUserPtr);
    Bounds3 b = shape->bounds();
    // Padding, since traversal rounds and bounds may be flat. The callback decides exactly.
    const float pad = 1e-5f * (b.radius() + length(b.center()));
    b.lo = b.lo - Vec3{pad, pad, pad};
    b.hi = b.hi + Vec3{pad, pad, pad};
    RTCBounds* out = args->bounds_o;
    out->lower_x = b.lo.x, out->lower_y = b.lo.y, out->lower_z = b.lo.z;
    out->upper_x = b.hi.x, out->upper_y = b.hi.y, out->upper_z = b.hi.z;
}

/// Embree loads four numbers at once. Such a load stalls on the stores of single numbers that precede it.
void set_ray(const Ray& ray, RTCRay& to) {
    using Lanes [[gnu::vector_size(16), gnu::may_alias]] = float;
    constexpr uint32_t kAllShapes = ~0u;
    Lanes* const lanes = reinterpret_cast<Lanes*>(&to);
    lanes[0] = Lanes{ray.o.x, ray.o.y, ray.o.z, 0};                      // and tnear
    lanes[1] = Lanes{ray.d.x, ray.d.y, ray.d.z, 0};                      // and time
    lanes[2] = Lanes{ray.tmax, std::bit_cast<float>(kAllShapes), 0, 0};  // tfar, mask, id, flags
}

bool intersect_analytic(const AnalyticShape& shape, const RTCRay& ray, AnalyticShape::Hit& hit) {
    return shape.intersect({ray.org_x, ray.org_y, ray.org_z}, {ray.dir_x, ray.dir_y, ray.dir_z},
                           ray.tnear, ray.tfar, hit);
}

// Only single rays are traced, so the packets passed by Embree have one element.
void intersect_callback(const RTCIntersectFunctionNArguments* args) {
    if (!args->valid[0]) return;
    auto* rayhit = reinterpret_cast<RTCRayHit*>(args->rayhit);
    AnalyticShape::Hit hit;
    if (!intersect_analytic(*static_cast<const AnalyticShape*>(args->geometryUserPtr), rayhit->ray,
                            hit))
        return;
    rayhit->ray.tfar = float(hit.t);
    rayhit->hit.Ng_x = hit.local.x;
    rayhit->hit.Ng_y = hit.local.y;
    rayhit->hit.Ng_z = hit.local.z;
    rayhit->hit.geomID = args->geomID;
    rayhit->hit.primID = args->primID;
    rayhit->hit.instID[0] = args->context->instID[0];
}

#if RTC_VERSION_MAJOR >= 4
using QueryContext = RTCRayQueryContext;
#else
using QueryContext = RTCIntersectContext;
#endif

/// A query for obstacles; callbacks get its context.
struct ObstacleQuery {
    QueryContext context;
    bool meets_passable = false;
};
static_assert(std::is_standard_layout_v<ObstacleQuery>);

void note_passable(QueryContext* context) {
    reinterpret_cast<ObstacleQuery*>(context)->meets_passable = true;
}

/// Rejects the hit: beyond it, there may be an opaque one.
void passable_filter(const RTCFilterFunctionNArguments* args) {
    if (!args->valid[0]) return;
    note_passable(args->context);
    args->valid[0] = 0;
}

template <bool is_passable>
void occluded_callback(const RTCOccludedFunctionNArguments* args) {
    if (!args->valid[0]) return;
    auto* ray = reinterpret_cast<RTCRay*>(args->ray);
    AnalyticShape::Hit hit;
    if (!intersect_analytic(*static_cast<const AnalyticShape*>(args->geometryUserPtr), *ray, hit))
        return;
    if constexpr (is_passable)
        note_passable(args->context);
    else
        ray->tfar = -kInf;
}

/// Embree inverts the matrix M of an instance in float, with an error of up to 2^-23 |M⁻¹| |M| |M⁻¹| [Higham 2002, §14.1]: the
/// largest sum of a row.
float error_of_inverse(const Transform& to_world) {
    constexpr double kErrors = 0x1p-23;
    const Transform::Matrix &m = to_world.matrix(), &m1 = to_world.inverse_matrix();
    double most = 0;
    for (size_t i = 0; i < 3; ++i) {
        double sum = 0;
        for (size_t j = 0; j < 3; ++j)
            for (size_t k = 0; k < 3; ++k)
                for (size_t l = 0; l < 3; ++l) sum += std::fabs(m1[i][j] * m[j][k] * m1[k][l]);
        most = std::max(most, sum);
    }
    return float(kErrors * most);
}

/// What Embree allocates, and how much it may.
struct MemoryBudget {
    std::atomic<int64_t> bytes{0};
    std::atomic<int64_t> most{0};
};

/// False refuses an allocation.
bool memory_callback(void* user, ssize_t bytes, bool) {
    auto& budget = *static_cast<MemoryBudget*>(user);
    const int64_t before = budget.bytes.fetch_add(bytes, std::memory_order_relaxed);
    if (bytes <= 0 || before + bytes <= budget.most) return true;
    budget.bytes.fetch_sub(bytes, std::memory_order_relaxed);
    return false;
}

/// Without the instruction set, Embree would choose that of the machine, and images of different machines would differ
/// in their last bits. The files would be .embree3 in the working directory and in the home directory.
#if defined(__AVX2__)
constexpr const char* kDevice = "isa=avx2,ignore_config_files=1";
#elif defined(__x86_64__)
constexpr const char* kDevice = "isa=sse4.2,ignore_config_files=1";
#else
constexpr const char* kDevice = "ignore_config_files=1";
#endif

}  // namespace

std::string ray_tracer() {
    // That of the library which was loaded.
    static const std::string version = [] {
        const RTCDevice device = rtcNewDevice(kDevice);
        const ssize_t v = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION);
        rtcReleaseDevice(device);
        return std::to_string(v / 10000) + '.' + std::to_string(v / 100 % 100) + '.' +
               std::to_string(v % 100);
    }();
    return "Embree " + version + ", " + kDevice;
}

size_t memory_of_machine() {
    return size_t(available_memory().value_or(UINT64_MAX));
}

namespace {

/// What hierarchies that share parts have in common.
struct Device {
    MemoryBudget memory;
    RTCDevice device = nullptr;

    Device() {
        device = rtcNewDevice(kDevice);
        if (!device) throw std::runtime_error("Embree cannot start, perhaps for want of memory");
        if (!rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED)) {
            rtcReleaseDevice(device);
            throw std::runtime_error(
                "this Embree has no filter functions, which masks need: it was built with "
                "EMBREE_FILTER_FUNCTION=OFF");
        }
        rtcSetDeviceMemoryMonitorFunction(device, memory_callback, &memory);
    }
    ~Device() { rtcReleaseDevice(device); }
    Device(const Device&) = delete;
    Device& operator=(const Device&) = delete;

    /// Allows that many bytes beside what is allocated.
    void allow(size_t most_bytes) {
        const int64_t used = std::max<int64_t>(0, memory.bytes);
        memory.most = int64_t(std::min(most_bytes, size_t(INT64_MAX - used))) + used;
    }
};

/// A part of the hierarchy, and its memory.
struct Part {
    std::shared_ptr<Device> device;
    RTCScene scene = nullptr;
    std::vector<Accelerator::Member> members;  ///< Of a group.
    int64_t bytes = 0;

    Part(std::shared_ptr<Device> on, bool is_watertight) : device(std::move(on)) {
        scene = rtcNewScene(device->device);
        rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
        if (is_watertight) rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    }
    ~Part() { rtcReleaseScene(scene); }
    Part(const Part&) = delete;
    Part& operator=(const Part&) = delete;
};

}  // namespace

struct Accelerator::Impl {
    AcceleratorOptions options;
    std::shared_ptr<Device> shared;
    RTCDevice device = nullptr;
    std::shared_ptr<Part> part;  ///< With the shapes and instances of the scene itself.
    RTCScene top = nullptr;
    std::vector<std::shared_ptr<const Part>> groups;
    /// Those of an earlier accelerator, by their members.
    std::map<std::vector<Member>, std::shared_ptr<const Part>> earlier_groups;
    std::vector<std::pair<uint32_t, uint32_t>> group_shapes;  ///< Indices [first, second).
    /// By geometry id of the top-level scene: index of the shape, or of the instance.
    std::vector<uint32_t> shape_of_geom;
    std::vector<Instance> instances;
    uint32_t shape_count = 0;
    std::vector<const AnalyticShape*> analytic;  ///< By shape; nullptr for meshes.
    int64_t bytes_before = 0;                    ///< Of the device, without the top and new groups.
    int64_t group_bytes = 0;                     ///< Of new groups.

    Impl(const AcceleratorOptions& o, std::shared_ptr<Device> on)
        : options(o), shared(std::move(on)), device(shared->device) {
        shared->allow(options.most_bytes);
        part = std::make_shared<Part>(shared, options.is_watertight);
        top = part->scene;
        bytes_before = shared->memory.bytes;
    }

    void check() const {
        const RTCError error = rtcGetDeviceError(device);
        if (error == RTC_ERROR_NONE) return;
        throw std::runtime_error(
            error == RTC_ERROR_OUT_OF_MEMORY
                ? "the ray-tracing hierarchy needs more than " +
                      format_bytes(uint64_t(options.most_bytes)) +
                      " of memory, which is all that is free; use instances or coarser meshes"
                : "Embree: error " + std::to_string(int(error)));
    }

    uint32_t attach(RTCScene scene, const Member& member) const {
        const Shape& shape = *member.shape;
        RTCGeometry geometry;
        if (const auto* mesh = dynamic_cast<const TriangleMesh*>(&shape)) {
            geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
            // Embree reads 16 bytes of a vertex, so the points must not end an array.
            using Vertex = TriangleMesh::Vertex;
            using Face = TriangleMesh::Face;
            static_assert(offsetof(Vertex, p) == 0 && sizeof(Vertex) >= 16);
            static_assert(offsetof(Face, vertices) == 0);
            rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                       mesh->vertices().data(), 0, sizeof(Vertex),
                                       mesh->vertices().size());
            rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                       mesh->faces().data(), 0, sizeof(Face), mesh->faces().size());
            if (member.may_let_rays_pass)
                rtcSetGeometryOccludedFilterFunction(geometry, passable_filter);
        } else {
            geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
            rtcSetGeometryUserPrimitiveCount(geometry, 1);
            rtcSetGeometryUserData(
                geometry, const_cast<AnalyticShape*>(dynamic_cast<const AnalyticShape*>(&shape)));
            rtcSetGeometryBoundsFunction(geometry, bounds_callback, nullptr);
            rtcSetGeometryIntersectFunction(geometry, intersect_callback);
            rtcSetGeometryOccludedFunction(geometry, member.may_let_rays_pass
                                                         ? occluded_callback<true>
                                                         : occluded_callback<false>);
        }
        rtcCommitGeometry(geometry);
        const uint32_t id = rtcAttachGeometry(scene, geometry);
        rtcReleaseGeometry(geometry);
        check();
        return id;
    }
};

Accelerator::Accelerator(const AcceleratorOptions& options)
    : impl_(std::make_shared<Impl>(options, std::make_shared<Device>())) {}

Accelerator::Accelerator(const AcceleratorOptions& options, const Accelerator& earlier)
    : impl_(std::make_shared<Impl>(options, earlier.impl_->shared)) {
    if (options.is_watertight == earlier.impl_->options.is_watertight)
        for (const auto& group : earlier.impl_->groups)
            impl_->earlier_groups.emplace(group->members, group);
}

uint32_t Accelerator::add_shape(const Member& member) {
    const uint32_t id = impl_->attach(impl_->top, member);
    impl_->shape_of_geom.resize(id + 1);
    impl_->analytic.push_back(dynamic_cast<const AnalyticShape*>(member.shape));
    return impl_->shape_of_geom[id] = impl_->shape_count++;
}

uint32_t Accelerator::add_group(const std::vector<Member>& members) {
    for (const Member& m : members)
        impl_->analytic.push_back(dynamic_cast<const AnalyticShape*>(m.shape));
    const uint32_t first = impl_->shape_count;
    impl_->shape_count += uint32_t(members.size());
    impl_->group_shapes.emplace_back(first, impl_->shape_count);
    const auto known = impl_->earlier_groups.find(members);
    if (known != impl_->earlier_groups.end()) {
        impl_->groups.push_back(known->second);
    } else {
        const int64_t before = impl_->shared->memory.bytes;
        auto group = std::make_shared<Part>(impl_->shared, impl_->options.is_watertight);
        group->members = members;
        for (const Member& m : members) impl_->attach(group->scene, m);  // ids count from 0
        rtcCommitScene(group->scene);
        impl_->check();
        group->bytes = impl_->shared->memory.bytes - before;
        impl_->group_bytes += group->bytes;
        impl_->groups.push_back(std::move(group));
    }
    return uint32_t(impl_->groups.size() - 1);
}

uint32_t Accelerator::add_instance(uint32_t group, const Transform& to_world) {
    RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry, impl_->groups[group]->scene);
    float m[12];
    for (int row = 0; row < 3; ++row)
        for (int col = 0; col < 4; ++col) m[row * 4 + col] = float(to_world.matrix()[row][col]);
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, m);
    rtcCommitGeometry(geometry);
    const uint32_t id = rtcAttachGeometry(impl_->top, geometry);
    rtcReleaseGeometry(geometry);
    impl_->check();
    impl_->shape_of_geom.resize(id + 1);
    impl_->shape_of_geom[id] = uint32_t(impl_->instances.size());
    impl_->instances.push_back({to_world, error_of_inverse(to_world),
                                largest_coordinate(to_world.point({0, 0, 0})),
                                impl_->group_shapes[group]});
    return uint32_t(impl_->instances.size() - 1);
}

void Accelerator::commit() {
    rtcCommitScene(impl_->top);
    impl_->check();
    impl_->part->bytes = impl_->shared->memory.bytes - impl_->bytes_before - impl_->group_bytes;
    impl_->earlier_groups.clear();
}

bool Accelerator::intersect(const Ray& ray, RayHit& out) const {
    RTCRayHit rh;
    set_ray(ray, rh.ray);
    rh.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rh.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if RTC_VERSION_MAJOR >= 4
    rtcIntersect1(impl_->top, &rh, nullptr);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(impl_->top, &context, &rh);
#endif
    if (rh.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
    out.t = rh.ray.tfar;
    out.prim = rh.hit.primID;
    out.u = rh.hit.u;
    out.v = rh.hit.v;
    if (rh.hit.instID[0] == RTC_INVALID_GEOMETRY_ID) {
        out.instance = kNoInstance;
        out.shape = impl_->shape_of_geom[rh.hit.geomID];
    } else {
        out.instance = impl_->shape_of_geom[rh.hit.instID[0]];
        out.shape = impl_->instances[out.instance].shapes.first + rh.hit.geomID;
    }
    if (const AnalyticShape* shape = impl_->analytic[out.shape]) {
        const Vec2 uv = shape->parameters({rh.hit.Ng_x, rh.hit.Ng_y, rh.hit.Ng_z});
        out.u = uv.x, out.v = uv.y;
    }
    return true;
}

Obstacle Accelerator::obstacle(const Ray& ray) const {
    RTCRay r;
    set_ray(ray, r);
    ObstacleQuery query;
#if RTC_VERSION_MAJOR >= 4
    rtcInitRayQueryContext(&query.context);
    RTCOccludedArguments arguments;
    rtcInitOccludedArguments(&arguments);
    arguments.context = &query.context;
    rtcOccluded1(impl_->top, &r, &arguments);
#else
    rtcInitIntersectContext(&query.context);
    rtcOccluded1(impl_->top, &query.context, &r);
#endif
    return r.tfar < 0             ? Obstacle::Opaque
           : query.meets_passable ? Obstacle::Passable
                                  : Obstacle::None;
}

size_t Accelerator::instance_count() const {
    return impl_->instances.size();
}

const Accelerator::Instance& Accelerator::instance(uint32_t index) const {
    return impl_->instances[index];
}

size_t Accelerator::memory_bytes() const {
    int64_t bytes = impl_->part->bytes;
    for (const auto& group : impl_->groups) bytes += group->bytes;
    return size_t(std::max<int64_t>(0, bytes));
}

}  // namespace etendue
