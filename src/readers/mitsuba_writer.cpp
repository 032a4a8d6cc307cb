#include "readers/mitsuba_writer.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <map>
#include <set>

#include <fmt/format.h>

#include "description/resolve_file.h"
#include "readers/ply.h"

namespace etendue {
namespace {

std::string escape(std::string_view text) {
    std::string out;
    for (const char c : text) switch (c) {
        case '&': out += "&amp;"; break;
        case '<': out += "&lt;"; break;
        case '>': out += "&gt;"; break;
        case '"': out += "&quot;"; break;
        case '$': out += "\\$"; break;
        default: out += c;
        }
    return out;
}

/// Of the file of an image, by its first bytes. Other programs choose the format by it.
const char* extension_of(std::string_view bytes) {
    if (bytes.starts_with("\xff\xd8")) return "jpg";
    if (bytes.starts_with("PF") || bytes.starts_with("Pf")) return "pfm";
    if (bytes.starts_with("\x76\x2f\x31\x01")) return "exr";
    if (bytes.starts_with("#?")) return "hdr";
    if (bytes.starts_with("BM")) return "bmp";
    return "png";
}

bool is_grey(Rgb c) {
    return c.r == c.g && c.g == c.b;
}

class Writer {
public:
    Writer(const SceneDescription& scene, const std::string& path, const std::string& files_folder,
           const std::function<void(const SceneFile&)>& add_file)
        : scene_(scene), folder_(std::filesystem::path(path).parent_path()),
          files_folder_(files_folder), add_file_(add_file), uses_(scene.objects.size()) {
        for (const SceneObject& o : scene.objects) {
            shows_vertex_colors_ |= o.type == "mesh_attribute";
            for (const auto& c : o.children) ++uses_[size_t(c.object)];
            if (!o.id.empty()) ids_.insert(o.id);
        }
        // Roots are written where they stand, and others refer to them.
        for (const int root : scene.roots) uses_[size_t(root)] += 2;
        for (const int root : scene.roots) find_inputs(root);
    }

    std::string run() {
        const bool has_integrator =
            std::any_of(scene_.roots.begin(), scene_.roots.end(), [&](int root) {
                return scene_.objects[size_t(root)].category == "integrator";
            });
        const bool has_media =
            std::any_of(scene_.objects.begin(), scene_.objects.end(),
                        [](const SceneObject& o) { return o.category == "medium"; });
        if (!has_integrator)
            line(1, fmt::format("<integrator type=\"{}\"/>", has_media ? "volpath" : "path"));
        for (const int root : scene_.roots) write_shared(root);
        for (const int root : scene_.roots)
            if (!written_.count(root)) write_object(root, "", 1);
        return "<scene version=\"3.0.0\">\n" + out_ + "</scene>\n";
    }

private:
    /// Whether several others refer to the object and it can stand in the scene itself.
    bool is_shared(int index) const {
        const SceneObject& o = scene_.objects[size_t(index)];
        const bool can_stand_alone = o.category == "bsdf" || o.category == "texture" ||
                                     o.category == "medium" || o.type == "shapegroup";
        return can_stand_alone && uses_[size_t(index)] > 1;
    }

    /// Finds the files that an object and its descendants name, before any file is written.
    void find_inputs(int index) {
        if (!searched_.insert(index).second) return;
        const SceneObject& o = scene_.objects[size_t(index)];
        const bool is_embedded = o.find("image") && !scene_.images.empty();
        for (const char* name : {"filename", "user_paths"}) {
            const Param* p = o.find(name);
            if (!p || p->type() != ParamType::String || is_embedded) continue;
            const std::string file = resolve_file({scene_, index}, name);
            inputs_[{index, name}] = file;
            taken_.insert(canonical(file));
        }
        for (const auto& c : o.children) find_inputs(c.object);
    }

    static std::filesystem::path canonical(const std::filesystem::path& file) {
        std::error_code error;
        const auto path = std::filesystem::weakly_canonical(file, error);
        return error ? file : path;
    }

    /// A name for a file that is made of an object: not that of a file that the scene reads.
    std::string free_name(const std::string& stem, const char* extension) const {
        std::string name = fmt::format("{}/{}.{}", files_folder_, stem, extension);
        for (int i = 1; taken_.contains(canonical(folder_ / name)); ++i)
            name = fmt::format("{}/{}_{}.{}", files_folder_, stem, i, extension);
        return name;
    }

    /// Writes the shared descendants of an object, the innermost first.
    void write_shared(int index) {
        if (!visited_.insert(index).second) return;
        for (const auto& c : scene_.objects[size_t(index)].children) {
            write_shared(c.object);
            if (is_shared(c.object) && written_.insert(c.object).second)
                write_object(c.object, "", 1);
        }
    }

    std::string id_of(int index) {
        const SceneObject& o = scene_.objects[size_t(index)];
        if (!o.id.empty()) return o.id;
        std::string& id = made_ids_[index];
        for (int i = index; id.empty(); ++i)
            if (ids_.insert(fmt::format("{}{}", o.category, i)).second)
                id = fmt::format("{}{}", o.category, i);
        return id;
    }

    void line(int depth, const std::string& text) {
        out_.append(size_t(depth) * 4, ' ');
        out_ += text + '\n';
    }

    void write_object(int index, const std::string& name, int depth) {
        SceneObject o = scene_.objects[size_t(index)];
        for (Param& p : o.params)
            if (const auto input = inputs_.find({index, p.name}); input != inputs_.end())
                p.value = name_in_folder(input->second);
        if (o.category == "shape") write_mesh(index, o);
        // Only the sample count of a sampler is used, and Mitsuba 3 does not have all of them.
        if (o.category == "sampler") o.type = "independent";
        if (o.category == "emitter" && !flag(o, "two_sided", true)) remove(o, "two_sided");
        if (o.find("image")) write_image(index, o);
        std::string open = fmt::format("<{} type=\"{}\"", o.category, escape(o.type));
        // An object that is written several times has its id once.
        if (is_shared(index) || (!o.id.empty() && named_.insert(o.id).second))
            open += fmt::format(" id=\"{}\"", escape(id_of(index)));
        if (!name.empty()) open += fmt::format(" name=\"{}\"", escape(name));
        line(depth, open + ">");
        for (const Param& p : o.params) write_param(o, p, depth + 1);
        for (const auto& c : o.children) {
            if (written_.count(c.object) && is_shared(c.object))
                line(
                    depth + 1,
                    fmt::format("<ref id=\"{}\"{}/>", escape(id_of(c.object)),
                                c.name.empty() ? "" : fmt::format(" name=\"{}\"", escape(c.name))));
            else
                write_object(c.object, c.name, depth + 1);
        }
        line(depth, fmt::format("</{}>", o.category));
    }

    void write_param(const SceneObject& o, const Param& p, int depth) {
        const std::string name = escape(p.name);
        const auto simple = [&](const char* element, const std::string& value) {
            line(depth, fmt::format("<{} name=\"{}\" value=\"{}\"/>", element, name, value));
        };
        switch (p.type()) {
        case ParamType::Bool: return simple("boolean", std::get<bool>(p.value) ? "true" : "false");
        case ParamType::Int:
            return simple("integer", fmt::format("{}", std::get<int64_t>(p.value)));
        case ParamType::Float: return simple("float", fmt::format("{}", std::get<double>(p.value)));
        case ParamType::String: return simple("string", escape(std::get<std::string>(p.value)));
        case ParamType::Vector: {
            const Vec3 v = std::get<Vec3>(p.value);
            const bool is_direction = p.name.find("direction") != p.name.npos;
            return line(depth, fmt::format("<{} name=\"{}\" x=\"{}\" y=\"{}\" z=\"{}\"/>",
                                           is_direction ? "vector" : "point", name, v.x, v.y, v.z));
        }
        case ParamType::Rgb: {
            const Rgb c = std::get<Rgb>(p.value);
            // A number is grey in materials; in emitters it would be a constant spectrum.
            if (is_grey(c) && o.category != "emitter")
                return simple("float", fmt::format("{}", c.r));
            return simple("rgb", fmt::format("{} {} {}", c.r, c.g, c.b));
        }
        case ParamType::Transform: {
            std::string numbers;
            for (const auto& row : p.as<Transform>()->matrix())
                for (const double v : row)
                    numbers += fmt::format("{}{}", numbers.empty() ? "" : " ", v);
            line(depth, fmt::format("<transform name=\"{}\">", name));
            line(depth + 1, fmt::format("<matrix value=\"{}\"/>", numbers));
            return line(depth, "</transform>");
        }
        }
    }

    /// A file of the scene, as seen from the folder of the XML file.
    std::string name_in_folder(const std::filesystem::path& file) const {
        std::error_code error;
        const auto relative = std::filesystem::proximate(
            file, folder_.empty() ? std::filesystem::path(".") : folder_, error);
        return error ? std::filesystem::absolute(file).string() : relative.string();
    }

    static void remove(SceneObject& o, std::string_view name) {
        std::erase_if(o.params, [&](const Param& p) { return p.name == name; });
    }
    static bool flag(const SceneObject& o, const char* name, bool fallback) {
        const Param* p = o.find(name);
        const bool* v = p ? std::get_if<bool>(&p->value) : nullptr;
        return v ? *v : fallback;
    }

    /// Meshes that the description holds, and those with parameters that Mitsuba does not have, become PLY files.
    void write_mesh(int index, SceneObject& o) {
        const bool has_own_rules = o.find("compute_normals") || o.find("flip_flat_normals");
        // Mitsuba 3 takes colours of 8 bits as numbers up to 255.
        const bool is_rewritten = has_own_rules || shows_vertex_colors_;
        if (o.type != "mesh" && !(o.type == "ply" && is_rewritten)) return;
        MeshData mesh;
        if (o.type == "mesh") {
            const Params params(scene_, index);
            const auto count = int64_t(scene_.meshes.size());
            if (!params.has("mesh") || count == 0)
                params.fail("shape \"mesh\" needs a mesh, which only some formats can hold");
            mesh = scene_.meshes[size_t(params.integer("mesh", 0, 0, count - 1))];
        } else {
            // Without a file name, resolve_file() reports what is missing.
            const auto input = inputs_.find({index, "filename"});
            mesh = read_ply(input != inputs_.end() ? input->second : resolve_file({scene_, index}),
                            {.flip_tex_coords = flag(o, "flip_tex_coords", false)});
        }
        const bool compute_normals = flag(o, "compute_normals", true);
        const bool is_flat = flag(o, "face_normals", false) || mesh.face_normals ||
                             (mesh.normals.empty() && !compute_normals);
        if (is_flat) {
            bool flip = flag(o, "flip_normals", false) != flag(o, "flip_flat_normals", false);
            const Transform t = Params(scene_, index).transform("to_world");
            if (!compute_normals && t.determinant3() < 0) flip = !flip;
            if (flip)
                for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
            mesh.normals.clear();
            remove(o, "flip_normals");
            remove(o, "face_normals");
            o.params.push_back({"face_normals", true, o.where});
        }
        for (const char* name :
             {"mesh", "filename", "compute_normals", "flip_flat_normals", "flip_tex_coords"})
            remove(o, name);
        const std::string name = free_name(fmt::format("mesh{}", index), "ply");
        add_file_({name, write_ply(mesh)});
        o.type = "ply";
        o.params.push_back({"filename", name, o.where});
    }

    void write_image(int object, SceneObject& o) {
        if (scene_.images.empty()) return remove(o, "image");  // without effect, as in a rendering
        const auto count = int64_t(scene_.images.size());
        const auto index = size_t(Params(scene_, object).integer("image", 0, 0, count - 1));
        const std::string& bytes = scene_.images[index]->bytes;
        const std::string name = free_name(fmt::format("image{}", index), extension_of(bytes));
        if (written_images_.insert(index).second) add_file_({name, bytes});
        remove(o, "image");
        o.params.push_back({"filename", name, o.where});
    }

    const SceneDescription& scene_;
    std::filesystem::path folder_;
    std::string files_folder_;
    const std::function<void(const SceneFile&)>& add_file_;
    std::vector<int> uses_;
    bool shows_vertex_colors_ = false;
    std::set<std::string> ids_, named_;
    std::map<int, std::string> made_ids_;
    std::set<int> searched_, visited_, written_;
    std::map<std::pair<int, std::string>, std::string> inputs_;  ///< By object and parameter.
    std::set<std::filesystem::path> taken_;  ///< The same files as canonical paths.
    std::set<size_t> written_images_;
    std::string out_;
};

void append_floats(std::string& out, const float* values, size_t count) {
    out.append(reinterpret_cast<const char*>(values), count * sizeof(float));
}

}  // namespace

std::string write_ply(const MeshData& mesh) {
    std::string out = fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n"
                                  "property float x\nproperty float y\nproperty float z\n",
                                  mesh.positions.size());
    const auto declare = [&](bool present, std::initializer_list<const char*> names) {
        if (present)
            for (const char* name : names) out += fmt::format("property float {}\n", name);
    };
    declare(!mesh.normals.empty(), {"nx", "ny", "nz"});
    declare(!mesh.uvs.empty(), {"u", "v"});
    declare(!mesh.colors.empty(), {"r", "g", "b"});
    declare(!mesh.alphas.empty(), {"a"});
    declare(!mesh.second_uvs.empty(), {"second_u", "second_v"});
    out += fmt::format("element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                       mesh.triangles.size());
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        append_floats(out, &mesh.positions[i].x, 3);
        if (!mesh.normals.empty()) append_floats(out, &mesh.normals[i].x, 3);
        if (!mesh.uvs.empty()) append_floats(out, &mesh.uvs[i].x, 2);
        if (!mesh.colors.empty()) append_floats(out, &mesh.colors[i].x, 3);
        if (!mesh.alphas.empty()) append_floats(out, &mesh.alphas[i], 1);
        if (!mesh.second_uvs.empty()) append_floats(out, &mesh.second_uvs[i].x, 2);
    }
    for (const auto& triangle : mesh.triangles) {
        out += char(3);
        out.append(reinterpret_cast<const char*>(triangle.data()), sizeof(triangle));
    }
    return out;
}

std::string write_mitsuba_xml(const SceneDescription& scene, const std::string& path,
                              const std::string& files_folder,
                              const std::function<void(const SceneFile&)>& add_file) {
    return Writer(scene, path, files_folder, add_file).run();
}

}  // namespace etendue
