#include "description/fingerprint.h"

#include <dlfcn.h>
#include <link.h>

#include <bit>
#include <filesystem>
#include <fstream>
#include <vector>

#include "description/resolve_file.h"
#include "math/content_hash.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

/// Adds the bytes of a file, which may be larger than the memory; none where it cannot be read.
void add_contents(const fs::path& path, ContentHash& hash) {
    std::ifstream in(path, std::ios::binary);
    std::vector<char> piece(size_t(1) << 16);
    uint64_t size = 0;
    while (in.read(piece.data(), std::streamsize(piece.size())), in.gcount() > 0) {
        hash.add_piece({piece.data(), size_t(in.gcount())});
        size += uint64_t(in.gcount());
    }
    hash.add(size);
}

/// The file from which the code of this function was loaded: the program, or a library such as the module of Python.
std::string file_with_code() {
    Dl_info ignored;
    void* loaded = nullptr;
    const bool is_known = ::dladdr1(reinterpret_cast<void*>(&file_with_code), &ignored, &loaded,
                                    RTLD_DL_LINKMAP) != 0;
    const std::string library = is_known ? static_cast<link_map*>(loaded)->l_name : "";
    // The program itself has no name there. It can be read under this one even after its file was replaced.
    return library.empty() ? "/proc/self/exe" : library;
}

/// Adds the parts of a description. Every function names all members of its type, so that a new one does not compile
/// until it is added here, or left out with a reason.
class Fingerprint {
public:
    explicit Fingerprint(const SceneDescription& scene) {
        // The folders count by the files that are found in them. `file`, `warnings` and `left_out` say what was read.
        const auto& [objects, roots, meshes, images, file, search_paths, warnings, left_out] =
            scene;
        folders_ = &search_paths;
        add_list(roots, [&](int root) { add(root); });
        add_list(objects, [&](const SceneObject& o) { add(o); });
        add_list(meshes, [&](const MeshData& m) { add(m); });
        add_list(images, [&](const EncodedImage& i) { add(i); });
    }
    uint64_t value() const { return hash_.value(); }

private:
    void add(const SceneObject& object) {
        const auto& [category, type, id, where, params, children] = object;
        hash_.add(category).add(type).add(id);
        add_list(params, [&](const Param& p) { add(p); });
        add_list(children, [&](const SceneObject::Child& c) { add(c); });
    }
    void add(const SceneObject::Child& child) {
        const auto& [name, object, where] = child;
        hash_.add(name);
        add(object);
    }
    void add(const Param& param) {
        const auto& [name, value, where] = param;
        hash_.add(name).add(uint64_t(value.index()));
        std::visit([&](const auto& v) { add(v); }, value);
        if (const auto* text = std::get_if<std::string>(&value)) add_file(*text);
    }
    void add(const MeshData& mesh) {
        // The name, the counts of what was mended and the notes are for messages.
        const auto& [name, positions, normals, uvs, second_uvs, colors, alphas, triangles,
                     face_normals, dropped_degenerate, replaced_normals, notes] = mesh;
        add_array(positions);
        add_array(normals);
        add_array(uvs);
        add_array(second_uvs);
        add_array(colors);
        add_array(alphas);
        add_array(triangles);
        add(face_normals);
    }
    void add(const EncodedImage& image) {
        const auto& [name, bytes] = image;  // the name is for messages
        hash_.add(bytes);
    }

    void add(bool v) { hash_.add(uint64_t(v)); }
    void add(int v) { hash_.add(uint64_t(v)); }
    void add(int64_t v) { hash_.add(uint64_t(v)); }
    void add(float v) { hash_.add(uint64_t(std::bit_cast<uint32_t>(v))); }
    void add(double v) { hash_.add(std::bit_cast<uint64_t>(v)); }
    void add(const std::string& v) { hash_.add(v); }
    void add(Vec3 v) { add(v.x), add(v.y), add(v.z); }
    void add(Rgb v) { add(v.r), add(v.g), add(v.b); }
    void add(const Transform& v) {
        for (const auto& row : v.matrix())
            for (const double x : row) add(x);
    }

    template <class List, class Use>
    void add_list(const List& list, const Use& use) {
        hash_.add(uint64_t(list.size()));
        for (const auto& element : list) use(element);
    }
    template <class T>
    void add_array(const std::vector<T>& values) {
        static_assert(std::has_unique_object_representations_v<T> || std::is_same_v<T, float> ||
                      std::is_same_v<T, Vec2> || std::is_same_v<T, Vec3>);
        hash_.add(std::string_view(reinterpret_cast<const char*>(values.data()),
                                   values.size() * sizeof(T)));
    }
    /// The contents of the file `name`, if there is one: what resolve_file() finds.
    void add_file(const std::string& name) {
        if (name.empty()) return;
        if (const auto path = find_file(name, *folders_)) add_contents(*path, hash_);
    }

    ContentHash hash_;
    const std::vector<std::string>* folders_ = nullptr;
};

}  // namespace

uint64_t scene_fingerprint(const SceneDescription& description) {
    return Fingerprint(description).value();
}

uint64_t file_fingerprint(const std::string& file) {
    ContentHash hash;
    add_contents(file, hash);
    return hash.value();
}

uint64_t program_fingerprint() {
    static const uint64_t of_first_call = file_fingerprint(file_with_code());
    return of_first_call;
}

}  // namespace etendue
