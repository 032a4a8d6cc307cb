#pragma once
// glTF files for tests: a document whose buffers, accessors and images are made by calls.

#include <cstring>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace etendue::test {

class GltfDocument {
public:
    using Json = nlohmann::json;
    static constexpr int kByte = 5121, kShort = 5123, kFloat = 5126;

    Json json = {{"asset", {{"version", "2.0"}}}};

    /// Appends to an array of the document, and returns the index.
    size_t add(const char* array, const Json& entry) {
        json[array].push_back(entry);
        return json[array].size() - 1;
    }
    template <class T>
    size_t accessor(const char* type, size_t components, int component_type,
                    const std::vector<T>& values, bool normalized = false) {
        while (bytes_.size() % 4 != 0) bytes_ += '\0';
        const size_t view = add("bufferViews", {{"buffer", 0},
                                                {"byteOffset", bytes_.size()},
                                                {"byteLength", values.size() * sizeof(T)}});
        bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
        return add("accessors", {{"bufferView", view},
                                 {"componentType", component_type},
                                 {"type", type},
                                 {"normalized", normalized},
                                 {"count", values.size() / components}});
    }
    /// The square [-1, 1]² in z = 0 as a mesh; `uvs` of its corners (-1,-1), (1,-1), (1,1), (-1,1). More attributes may
    /// be added.
    size_t square(size_t material, const std::vector<float>& uvs = {0, 1, 1, 1, 1, 0, 0, 0},
                  const Json& more = Json::object()) {
        const std::vector<float> p = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
        Json attributes = {{"POSITION", accessor("VEC3", 3, kFloat, p)},
                           {"TEXCOORD_0", accessor("VEC2", 2, kFloat, uvs)}};
        attributes.update(more);
        const size_t indices =
            accessor("SCALAR", 1, kShort, std::vector<uint16_t>{0, 1, 2, 0, 2, 3});
        const Json primitive = {
            {"attributes", attributes}, {"indices", indices}, {"material", material}};
        return add("meshes", {{"primitives", Json::array({primitive})}});
    }
    size_t node(const Json& entry) { return add("nodes", entry); }
    /// A material of this emission alone.
    static Json glow(const Json& factor) {
        return {
            {"pbrMetallicRoughness", {{"baseColorFactor", {0, 0, 0, 1}}, {"metallicFactor", 0}}},
            {"emissiveFactor", factor}};
    }
    /// An orthographic camera at z = 5 that sees the square [-1, 1]².
    void camera() {
        add("cameras", {{"type", "orthographic"},
                        {"orthographic", {{"xmag", 1}, {"ymag", 1}, {"znear", 0}, {"zfar", 9}}}});
        node({{"camera", 0}, {"translation", {0, 0, 5}}});
    }
    /// The only nodes without parents.
    void set_roots(const std::vector<size_t>& nodes) {
        const Json scene = {{"nodes", nodes}};
        json["scenes"] = Json::array({scene});
    }
    const std::string& bytes() const { return bytes_; }
    /// The document with its buffer under this URI.
    std::string text(const std::string& uri) const {
        Json whole = json;
        const Json buffer = {{"uri", uri}, {"byteLength", bytes_.size()}};
        whole["buffers"] = Json::array({buffer});
        return whole.dump();
    }

private:
    std::string bytes_;
};

inline void write_file(const std::filesystem::path& path, std::string_view bytes) {
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << bytes;
}

}  // namespace etendue::test
