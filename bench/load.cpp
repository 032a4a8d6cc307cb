// Speed of loading: files that this program writes, and the parts of loading whole scenes. All times are processor time,
// summed over threads.

#include <cmath>
#include <ctime>
#include <fstream>
#include <functional>

#include <fmt/format.h>
#include <unistd.h>

#include "description/resolve_file.h"
#include "readers/obj.h"
#include "readers/ply.h"
#include "readers/scene_file.h"
#include "scene/builder.h"
#include "scene/shape_registry.h"
#include "support.h"
#include "texture/texture_cache.h"

namespace etendue::bench {
namespace {

namespace fs = std::filesystem;

template <class Work>
double processor_seconds(const Work& work) {
    const std::clock_t start = std::clock();
    work();
    return double(std::clock() - start) / CLOCKS_PER_SEC;
}

/// A folder that is removed with its contents at the end.
struct TemporaryFolder {
    fs::path path = fs::temp_directory_path() / fmt::format("etendue-bench-load-{}", getpid());
    TemporaryFolder() { fs::create_directory(path); }
    ~TemporaryFolder() { fs::remove_all(path); }
};

/// A wavy surface of n × n vertices with normals and texture coordinates.
struct WavySurface {
    int n;

    Vec2 uv(int i, int j) const { return {float(i) / float(n - 1), float(j) / float(n - 1)}; }
    Vec3 position(int i, int j) const {
        const Vec2 t = uv(i, j);
        return {10 * t.x, 10 * t.y, std::sin(7 * t.x) * std::cos(5 * t.y)};
    }
    Vec3 normal(int i, int j) const {
        const Vec2 t = uv(i, j);
        return normalize(Vec3{-0.7f * std::cos(7 * t.x) * std::cos(5 * t.y),
                              0.5f * std::sin(7 * t.x) * std::sin(5 * t.y), 1});
    }
    template <class F>
    void for_vertices(const F& f) const {
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i) f(position(i, j), normal(i, j), uv(i, j));
    }
    template <class F>
    void for_triangles(const F& f) const {
        for (int j = 0; j + 1 < n; ++j)
            for (int i = 0; i + 1 < n; ++i) {
                const int a = j * n + i;
                f(a, a + 1, a + n + 1);
                f(a, a + n + 1, a + n);
            }
    }
};

void write_ply(const WavySurface& surface, std::ofstream& out) {
    const int n = surface.n;
    out << fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n"
                       "property float y\nproperty float z\nproperty float nx\nproperty float ny\n"
                       "property float nz\nproperty float u\nproperty float v\nelement face {}\n"
                       "property list uchar int vertex_indices\nend_header\n",
                       n * n, 2 * (n - 1) * (n - 1));
    surface.for_vertices([&](Vec3 p, Vec3 normal, Vec2 uv) {
        const float record[8] = {p.x, p.y, p.z, normal.x, normal.y, normal.z, uv.x, uv.y};
        out.write(reinterpret_cast<const char*>(record), sizeof record);
    });
    surface.for_triangles([&](int a, int b, int c) {
        const int indices[3] = {a, b, c};
        out.put(3).write(reinterpret_cast<const char*>(indices), sizeof indices);
    });
}

void write_obj(const WavySurface& surface, std::ofstream& out) {
    surface.for_vertices([&](Vec3 p, Vec3 normal, Vec2 uv) {
        out << fmt::format("v {} {} {}\nvn {} {} {}\nvt {} {}\n", p.x, p.y, p.z, normal.x, normal.y,
                           normal.z, uv.x, uv.y);
    });
    surface.for_triangles([&](int a, int b, int c) {
        out << fmt::format("f {0}/{0}/{0} {1}/{1}/{1} {2}/{2}/{2}\n", a + 1, b + 1, c + 1);
    });
}

constexpr const char* kPbrtHead = "Camera \"perspective\"\nWorldBegin\n";

void write_pbrt_mesh(const WavySurface& surface, std::ofstream& out) {
    out << kPbrtHead << "Shape \"trianglemesh\"\n  \"point3 P\" [\n";
    surface.for_vertices(
        [&](Vec3 p, Vec3, Vec2) { out << fmt::format("{} {} {}\n", p.x, p.y, p.z); });
    out << "]\n  \"normal N\" [\n";
    surface.for_vertices(
        [&](Vec3, Vec3 n, Vec2) { out << fmt::format("{} {} {}\n", n.x, n.y, n.z); });
    out << "]\n  \"point2 uv\" [\n";
    surface.for_vertices([&](Vec3, Vec3, Vec2 uv) { out << fmt::format("{} {}\n", uv.x, uv.y); });
    out << "]\n  \"integer indices\" [\n";
    surface.for_triangles([&](int a, int b, int c) { out << fmt::format("{} {} {}\n", a, b, c); });
    out << "]\n";
}

/// Many small objects, each with a transform and a material of its own.
void write_pbrt_directives(int count, std::ofstream& out) {
    out << kPbrtHead;
    for (int i = 0; i < count; ++i)
        out << fmt::format("AttributeBegin\n  Translate {0} {1} 0.5\n  Rotate {0} 0 0 1\n"
                           "  Material \"diffuse\" \"rgb reflectance\" [ 0.25 0.5 0.75 ]\n"
                           "  Shape \"sphere\" \"float radius\" [ 0.25 ]\nAttributeEnd\n",
                           i % 1000, i / 1000);
}

/// Writes `file` with `write`, and reports with how many MB/s `read` reads it.
void measure_file(const Report& report, const Options& options, const std::string& name,
                  const fs::path& file, std::optional<double> aim,
                  const std::function<void(std::ofstream&)>& write,
                  const std::function<void(const std::string&)>& read) {
    if (!report.wants(name)) return;
    {
        std::ofstream out(file, std::ios::binary);
        write(out);
    }
    const double megabytes = double(fs::file_size(file)) * 1e-6;
    read(file.string());
    std::vector<double> rates;
    for (int i = 0; i < options.repeats; ++i)
        rates.push_back(megabytes / processor_seconds([&] { read(file.string()); }));
    fs::remove(file);
    report.add(name, {{"rate", "MB/s", true, rates, aim}}, {{"megabytes", megabytes}});
}

void measure_files(const Report& report, const Options& options) {
    const TemporaryFolder folder;
    const WavySurface large{options.quick ? 50 : 1400}, medium{options.quick ? 50 : 700};
    const auto scene = [](const std::string& file) { read_scene_file(file); };
    measure_file(
        report, options, "binary ply", folder.path / "a.ply", 100,
        [&](std::ofstream& out) { write_ply(large, out); },
        [](const std::string& file) { read_ply(file); });
    measure_file(
        report, options, "obj", folder.path / "a.obj", {},
        [&](std::ofstream& out) { write_obj(medium, out); },
        [](const std::string& file) { read_obj(file); });
    measure_file(
        report, options, "pbrt mesh", folder.path / "mesh.pbrt", 50,
        [&](std::ofstream& out) { write_pbrt_mesh(medium, out); }, scene);
    measure_file(
        report, options, "pbrt directives", folder.path / "many.pbrt", 50,
        [&](std::ofstream& out) { write_pbrt_directives(options.quick ? 100 : 100'000, out); },
        scene);
}

/// Calls `visit` for the objects of a category.
template <class Visit>
void for_objects(const SceneDescription& description, const char* category, const Visit& visit) {
    for (size_t i = 0; i < description.objects.size(); ++i)
        if (description.objects[i].category == category) visit(Params(description, int(i)));
}

/// All shapes, as far as their files are concerned.
void make_shapes(const SceneDescription& description) {
    for_objects(description, "shape", [&](const Params& p) {
        for (const ShapeEntry& e : shape_registry())
            if (p.object().type == e.info.name) e.make(p, [](const std::string&) {});
    });
}

void load_images(const SceneDescription& description) {
    TextureCache images;
    for_objects(description, "texture", [&](const Params& p) {
        if (p.object().type == "bitmap" && p.has("filename"))
            images.load(resolve_file(p), p.flag("raw", false));
    });
}

void build_hierarchy(const Scene& scene) {
    Accelerator accelerator;
    for (const SceneShape& s : scene.shapes()) accelerator.add_shape({s.shape});
    accelerator.commit();
}

void measure_scene(const Report& report, const Options& options, const SceneFile& file) {
    if (!report.wants(file.name)) return;
    if (!fs::exists(file.path)) return report.skip(file.name, "there is no such scene file");
    const std::string path = file.path.string();
    ReadOptions read_options;
    BuildOptions build_options;
    read_options.lenient = build_options.lenient = true;
    const auto read = [&] { return read_scene_file(path, read_options); };
    const SceneDescription description = read();
    const auto build = [&] { return build_scene(description, build_options); };
    const Scene scene = build();
    std::vector<double> text, meshes, images, hierarchy, whole, first_pass;
    for (int i = 0; i < options.repeats; ++i) {
        text.push_back(processor_seconds(read));
        meshes.push_back(processor_seconds([&] { make_shapes(description); }));
        images.push_back(processor_seconds([&] { load_images(description); }));
        hierarchy.push_back(processor_seconds([&] { build_hierarchy(scene); }));
        whole.push_back(processor_seconds([&] { build(); }));
        first_pass.push_back(processor_seconds([&] {
            render(scene, integrator_for(scene, "path"), 0, {.passes = 1, .seconds = {}});
        }));
    }
    report.add(file.name, {{"text", "s", false, text},
                           {"meshes", "s", false, meshes},
                           {"images", "s", false, images},
                           {"hierarchy", "s", false, hierarchy},
                           {"scene", "s", false, whole},
                           {"first_pass", "s", false, first_pass}});
}

}  // namespace
}  // namespace etendue::bench

int main(int argc, char** argv) {
    using namespace etendue::bench;
    const Options options = Options::parse(argc, argv);
    const Report report("load", options);
    measure_files(report, options);
    for (const SceneFile& file :
         {shared_scene("bathroom-pbrt4", "bathroom", "bathroom.pbrt"),
          shared_scene("barcelona-pavilion-pbrt3", "barcelona-pavilion", "pavilion-day.pbrt"),
          shared_scene("living-room-mts06", "living-room", "scene.xml")})
        measure_scene(report, options, file);
}
