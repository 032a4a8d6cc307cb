// Processor time, in nanoseconds, of random numbers, BSDFs, emitters, walks, joins, weights and ray queries; and sizes
// of stored data in bytes.

#include <benchmark/benchmark.h>

#include <functional>
#include <list>
#include <memory>

#include "math/warp.h"
#include "pathspace/join.h"
#include "pathspace/mis.h"
#include "readers/mitsuba_xml.h"
#include "reuse/light_vertex_cache.h"
#include "scene/builder.h"
#include "support.h"

namespace etendue::bench {
namespace {

/// Number of inputs, which are sampled beforehand and used in turn, so that branch predictors do not learn them.
constexpr size_t kInputs = 1 << 12;

/// One operation on input i; its result is not optimised away.
template <class Operation>
void add(const Report& report, const Options& options, const std::string& name,
         const Operation& operation) {
    if (!report.wants(name)) return;
    benchmark::RegisterBenchmark(name.c_str(),
                                 [operation](benchmark::State& state) {
                                     Operation run = operation;
                                     size_t i = 0;
                                     for (auto _ : state) {
                                         auto result = run(i);
                                         benchmark::DoNotOptimize(result);
                                         i = (i + 1) % kInputs;
                                     }
                                 })
        ->Repetitions(options.repeats)
        ->MinTime(options.seconds / 10);
}

/// Google Benchmark's runs as result lines.
class LineReporter final : public benchmark::BenchmarkReporter {
public:
    explicit LineReporter(const Report& report) : report_(report) {}
    bool ReportContext(const Context&) override { return true; }
    void ReportRuns(const std::vector<Run>& runs) override {
        Figure time{"time", "ns", false, {}};
        for (const Run& run : runs)
            if (run.run_type == Run::RT_Iteration) time.runs.push_back(run.GetAdjustedCPUTime());
        if (!time.runs.empty()) report_.add(runs.front().run_name.function_name, {time});
    }

private:
    const Report& report_;
};

std::vector<Vec3> directions(uint64_t seed, bool upper_hemisphere) {
    Sampler sampler(SamplerKind::Independent, seed);
    sampler.start(0, 0);
    std::vector<Vec3> w(kInputs);
    for (Vec3& v : w) {
        v = sample_uniform_sphere(sampler.next_2d());
        if (upper_hemisphere) v.z = std::fabs(v.z);
    }
    return w;
}

std::vector<Vec2> numbers(uint64_t seed) {
    Sampler sampler(SamplerKind::Independent, seed);
    sampler.start(0, 0);
    std::vector<Vec2> u(kInputs);
    for (Vec2& v : u) v = sampler.next_2d();
    return u;
}

Scene build(const std::string& body) {
    return build_scene(
        parse_mitsuba_xml("<scene version=\"3.0.0\">" + body + "</scene>", "micro.xml"));
}

std::string sensor() {
    return R"(<sensor type="perspective"><float name="fov" value="45"/>
        <transform name="to_world"><lookat origin="0,0,3.4" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="64"/>
        <rfilter type="box"/></film></sensor>)";
}

std::string rectangle(const std::string& transform, const std::string& content) {
    return "<shape type=\"rectangle\"><transform name=\"to_world\">" + transform + "</transform>" +
           content + "</shape>";
}

const std::string kDiffuse = R"(<bsdf type="diffuse"/>)";
const std::string kAreaLight =
    R"(<emitter type="area"><rgb name="radiance" value="9,8,7"/></emitter>)";

/// The room [-1, 1]³, open toward the camera, with a lamp, a ball of glass and one of rough metal.
Scene make_room() {
    const std::string wall = R"(<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>)";
    const auto ball = [](const char* x, const char* bsdf) {
        return std::string("<shape type=\"sphere\"><point name=\"center\" value=\"") + x +
               ",-0.6,0\"/><float name=\"radius\" value=\"0.35\"/>" + bsdf + "</shape>";
    };
    return build(
        sensor() + rectangle(R"(<rotate x="1" angle="-90"/><translate y="-1"/>)", wall) +
        rectangle(R"(<rotate x="1" angle="90"/><translate y="1"/>)", wall) +
        rectangle(R"(<translate z="-1"/>)", wall) +
        rectangle(R"(<rotate y="1" angle="90"/><translate x="-1"/>)", wall) +
        rectangle(R"(<rotate y="1" angle="-90"/><translate x="1"/>)", wall) +
        rectangle(R"(<scale value="0.25"/><rotate x="1" angle="90"/><translate y="0.98"/>)",
                  kDiffuse + kAreaLight) +
        ball("-0.45", R"(<bsdf type="dielectric"/>)") +
        ball("0.45", R"(<bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>)"));
}

void add_samplers(const Report& report, const Options& options) {
    for (const auto& [name, kind] : {std::pair("independent", SamplerKind::Independent),
                                     std::pair("sobol", SamplerKind::Sobol)}) {
        // A pass and a vertex change as they do in a walk: three calls a vertex.
        add(report, options, std::string("sampler ") + name + " next_2d",
            [sampler = Sampler(kind, 1)](size_t i) mutable {
                if (i % 32 == 0) sampler.start(uint32_t(i / 32), i);
                sampler.seek(Stream::Eye, uint32_t(i % 32));
                return sampler.next_2d();
            });
    }
}

/// One surface with the material, at its shading frame, and its BSDF there for each input
/// direction.
struct BsdfInputs {
    std::vector<Vec3> wo = directions(1, true), wi = directions(2, true);
    std::vector<Vec2> u = numbers(3);
    Scene scene;
    ComponentArena arena;
    std::vector<Bsdf> bsdfs;

    explicit BsdfInputs(const std::string& bsdf)
        : scene(build(sensor() + rectangle("", bsdf + kAreaLight))) {
        const Material& material = *scene.shapes().front().material;
        if (material.is_transmissive()) wi = directions(2, false);
        for (Vec3 w : wo) bsdfs.push_back(material.bsdf(point(w), arena));
    }
    static SurfacePoint point(Vec3 wo) {
        return {.p = {},
                .ng = {0, 0, 1},
                .ns = {0, 0, 1},
                .dpdu = {1, 0, 0},
                .dpdv = {0, 1, 0},
                .uv = {0.3f, 0.6f},
                .wo = wo};
    }
};

void add_bsdfs(const Report& report, const Options& options, std::list<BsdfInputs>& keep) {
    for (const auto& [name, xml] : std::initializer_list<std::pair<std::string, std::string>>{
             {"diffuse", kDiffuse},
             {"conductor", R"(<bsdf type="conductor"/>)"},
             {"roughconductor",
              R"(<bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>)"},
             {"dielectric", R"(<bsdf type="dielectric"/>)"},
             {"thindielectric", R"(<bsdf type="thindielectric"/>)"},
             {"roughdielectric",
              R"(<bsdf type="roughdielectric"><float name="alpha" value="0.2"/></bsdf>)"},
             {"plastic", R"(<bsdf type="plastic"/>)"},
             {"roughplastic",
              R"(<bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf>)"},
             {"phong", R"(<bsdf type="phong"/>)"},
             {"principled", R"(<bsdf type="principled"><float name="roughness" value="0.4"/>
                              <float name="metallic" value="0.3"/></bsdf>)"},
             {"principled, dielectric",
              R"(<bsdf type="principled"><float name="roughness" value="0.4"/></bsdf>)"},
             {"principled, metal", R"(<bsdf type="principled"><float name="roughness" value="0.4"/>
                                     <float name="metallic" value="1"/></bsdf>)"},
             {"principled, glass", R"(<bsdf type="principled"><float name="roughness" value="0.4"/>
                                     <float name="spec_trans" value="1"/></bsdf>)"},
             {"openpbr", R"(<bsdf type="openpbr"><float name="specular_roughness" value="0.4"/>
                           <float name="base_metalness" value="0.3"/></bsdf>)"},
             {"openpbr, dielectric",
              R"(<bsdf type="openpbr"><float name="specular_roughness" value="0.4"/></bsdf>)"},
             {"openpbr, metal",
              R"(<bsdf type="openpbr"><float name="specular_roughness" value="0.4"/>
                <float name="base_metalness" value="1"/></bsdf>)"},
             {"openpbr, glass",
              R"(<bsdf type="openpbr"><float name="specular_roughness" value="0.4"/>
                <float name="transmission_weight" value="1"/></bsdf>)"},
             {"openpbr, coated",
              R"(<bsdf type="openpbr"><float name="specular_roughness" value="0.4"/>
                <float name="coat_weight" value="1"/></bsdf>)"},
             {"blendbsdf",
              R"(<bsdf type="blendbsdf"><float name="weight" value="0.4"/><bsdf type="diffuse"/>
                             <bsdf type="roughconductor"/></bsdf>)"}}) {
        const BsdfInputs& in = keep.emplace_back(xml);
        add(report, options, "bsdf make " + name,
            [&in, arena = std::make_shared<ComponentArena>()](size_t i) {
                arena->reset();
                return in.scene.shapes().front().material->bsdf(BsdfInputs::point(in.wo[i]),
                                                                *arena);
            });
        add(report, options, "bsdf eval " + name, [&in](size_t i) {
            return in.bsdfs[i].eval(in.wo[i], in.wi[i], TransportMode::Radiance);
        });
        add(report, options, "bsdf sample " + name, [&in](size_t i) {
            return in.bsdfs[i].sample(in.wo[i], in.u[i].x, in.u[(i + 1) % kInputs],
                                      TransportMode::Radiance);
        });
    }
}

struct EmitterInputs {
    std::vector<Vec3> from = directions(4, true);
    std::vector<Vec2> u = numbers(5), v = numbers(6);
    Scene scene;
};

void add_emitters(const Report& report, const Options& options, std::list<EmitterInputs>& keep) {
    const std::string floor = rectangle("", kDiffuse);
    for (const auto& [name, xml] : std::initializer_list<std::pair<std::string, std::string>>{
             {"area rectangle",
              rectangle(R"(<rotate x="1" angle="180"/><translate z="3"/>)", kAreaLight)},
             {"area sphere", R"(<shape type="sphere"><point name="center" value="0,0,5"/>)" +
                                 kAreaLight + "</shape>"},
             {"point", R"(<emitter type="point"><point name="position" value="0,0,3"/></emitter>)"},
             {"directional",
              R"(<emitter type="directional"><vector name="direction" value="0,0,-1"/></emitter>)"},
             {"constant", R"(<emitter type="constant"/>)"},
             {"sky", R"(<emitter type="sky"/>)"}}) {
        const EmitterInputs& in =
            keep.emplace_back(EmitterInputs{.scene = build(sensor() + floor + xml)});
        const Emitter& emitter = *in.scene.emitters().front();
        add(report, options, "emitter sample_direct " + name, [&](size_t i) {
            DirectSample d;
            const bool lit = emitter.sample_direct(in.from[i], {in.u[i].x, in.u[i].y}, d);
            return lit ? d.pdf : 0.0f;
        });
        add(report, options, "emitter sample_emission " + name, [&](size_t i) {
            return emitter.sample_emission({in.u[i].x, in.u[i].y}, in.v[i]).pdf_d;
        });
    }
}

/// Pairs of sub-paths in the room with enough vertices to be joined at s = t = 3.
struct WalkInputs {
    static constexpr TechniqueCounts kCounts{
        .hit = 1, .next_event = 1, .connect = 1, .splat = 4096};
    static constexpr WalkOptions kWalk{.max_vertices = 6};
    static constexpr size_t kPairs = 256;

    Scene scene = make_room();
    Film film{scene.film(), scene.filter()};
    std::vector<SubPath> y, z;
    std::vector<Ray> rays;

    WalkInputs() {
        for (uint64_t index = 0; z.size() < kPairs; ++index) {
            SubPath light, eye;
            walk_light(index, light);
            walk_eye(index, eye);
            if (light.size() < 4 || eye.size() < 4 || !light[2].is_connectible ||
                !eye[2].is_connectible)
                continue;
            y.push_back(std::move(light));
            z.push_back(std::move(eye));
        }
        const auto d = directions(7, false);
        for (size_t i = 0; i < kInputs; ++i)
            rays.push_back({z[i % kPairs][2].p * 0.999f, d[i], kInf});
    }
    int walk_eye(uint64_t index, SubPath& path) const {
        Sampler sampler(SamplerKind::Independent, 8);
        RenderStats stats;
        sampler.start(0, index);
        trace_eye_path({scene, kCounts, stats, kWalk}, film, index % film.geometry().pixel_count(),
                       sampler, path);
        return path.size();
    }
    int walk_light(uint64_t index, SubPath& path) const {
        Sampler sampler(SamplerKind::Independent, 9);
        RenderStats stats;
        sampler.start(0, index);
        trace_light_path({scene, kCounts, stats, kWalk}, sampler, path);
        return path.size();
    }
};

void add_path_space(const Report& report, const Options& options, const WalkInputs& in) {
    constexpr auto counts = WalkInputs::kCounts;
    add(report, options, "walk eye",
        [&, path = std::make_shared<SubPath>()](size_t i) { return in.walk_eye(i, *path); });
    add(report, options, "walk light",
        [&, path = std::make_shared<SubPath>()](size_t i) { return in.walk_light(i, *path); });
    add(report, options, "scene intersect", [&](size_t i) {
        SurfaceHit hit;
        return in.scene.intersect(in.rays[i], 0.5f, hit) ? hit.t : 0;
    });
    add(report, options, "scene transmittance", [&](size_t i) {
        const Vertex &a = in.y[i % WalkInputs::kPairs][2], &b = in.z[i * 7 % WalkInputs::kPairs][2];
        return in.scene.transmittance(a.ray_end(), b.ray_end());
    });
    add(report, options, "join next_event",
        [&, sampler = Sampler(SamplerKind::Independent, 10)](size_t i) mutable {
            sampler.start(0, i);
            const auto join =
                join_next_event(in.scene, in.z[i % WalkInputs::kPairs], 3, sampler, counts);
            return join ? join->mis_weight : 0;
        });
    add(report, options, "join connect", [&](size_t i) {
        const auto join = join_connect(in.scene, in.y[i % WalkInputs::kPairs], 3,
                                       in.z[i * 7 % WalkInputs::kPairs], 3, counts);
        return join ? join->mis_weight : 0;
    });
    add(report, options, "join splat",
        [&, sampler = Sampler(SamplerKind::Independent, 11)](size_t i) mutable {
            sampler.start(0, i);
            const auto join =
                join_splat(in.scene, in.y[i % WalkInputs::kPairs], 3, sampler, counts);
            return join ? join->mis_weight : 0;
        });
    add(report, options, "mis weight of a connection", [&](size_t i) {
        const SubPath &y = in.y[i % WalkInputs::kPairs], &z = in.z[i * 7 % WalkInputs::kPairs];
        return power_heuristic(counts.connect,
                               outward_sum<Side::Light>(y, 2, false, {0.4, 0.3}, counts) +
                                   outward_sum<Side::Eye>(z, 2, false, {0.2, 0.1}, counts));
    });
}

void report_sizes(const Report& report) {
    if (!report.wants("sizes")) return;
    const auto bytes = [](const char* name, size_t size) {
        return Figure{name, "bytes", false, {double(size)}};
    };
    report.add("sizes",
               {bytes("light_vertex", sizeof(LightVertex)), bytes("vertex", sizeof(Vertex)),
                bytes("bsdf", sizeof(Bsdf)), bytes("bsdf_component", sizeof(BsdfComponent)),
                bytes("lobe", sizeof(Lobe)), bytes("join", sizeof(Join))});
}

}  // namespace
}  // namespace etendue::bench

int main(int argc, char** argv) {
    using namespace etendue::bench;
    const Options options = Options::parse(argc, argv);
    const Report report("micro", options);
    report_sizes(report);

    std::list<BsdfInputs> bsdfs;
    std::list<EmitterInputs> emitters;
    const WalkInputs walks;
    add_samplers(report, options);
    add_bsdfs(report, options, bsdfs);
    add_emitters(report, options, emitters);
    add_path_space(report, options, walks);
    int no_arguments = 1;
    benchmark::Initialize(&no_arguments, argv);
    LineReporter lines(report);
    benchmark::RunSpecifiedBenchmarks(&lines);
}
