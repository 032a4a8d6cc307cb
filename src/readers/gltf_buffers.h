#pragma once
// The binary data of a glTF file: buffers, views of them, and accessors.

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "readers/gltf_json.h"
#include "system/available_memory.h"

namespace etendue {

/// Text with %20 and the like decoded.
std::string decode_percent(std::string_view uri);

class GltfBuffers {
public:
    /// Returns the contents of a file that the scene names; fails at `where` if there are none.
    using LoadFile = std::function<std::string(const std::string& name, const JsonValue& where)>;

    /// `chunk` is the binary chunk of a .glb file. `root` must outlive the object.
    GltfBuffers(const JsonValue& root, std::string_view chunk, LoadFile load);

    size_t view_count() const { return views_.size(); }
    /// The bytes of a bufferView.
    std::string_view view(size_t index);
    /// The bytes that a URI stands for: data, in base64 or not, or a file.
    std::string uri(const JsonValue& where);

    /// The values of an accessor.
    struct Values {
        size_t count = 0, components = 0;
        std::vector<float> numbers;  ///< count × components; normalised integers are fractions.
        bool normalized = false;
        double largest = 0;  ///< Of the type if it is an integer.
    };
    /// Some of the values of an accessor.
    struct Range {
        size_t first = 0, end = size_t(-1);
    };
    /// `types`: those allowed, e.g. "VEC3 VEC4". Only the values of `range` are read.
    Values floats(const JsonValue& accessor_index, std::string_view types, Range range);
    Values floats(const JsonValue& accessor_index, std::string_view types) {
        return floats(accessor_index, types, {});
    }
    /// Number of elements of an accessor.
    size_t count(const JsonValue& accessor_index) const;
    /// Whether the accessor names bytes, all of them or some.
    bool has_bytes(const JsonValue& accessor_index) const;
    /// Fails where the accessor names no bytes, and its values would be zero.
    void require_bytes(const JsonValue& accessor_index) const;
    /// Values of unsigned integers.
    std::vector<uint32_t> indices(const JsonValue& accessor_index);

private:
    struct Layout;
    Layout read_layout(const JsonValue& accessor) const;
    template <class Store>
    void read(const JsonValue& accessor, const Layout& layout, Range range, const Store& store);
    const JsonValue& accessor(const JsonValue& accessor_index) const;
    const std::string& buffer(size_t index);

    std::vector<JsonValue> buffers_, views_, accessors_;
    std::string_view chunk_;
    LoadFile load_;
    std::vector<std::optional<std::string>> loaded_;
    MemoryWatch watch_;  ///< Over buffers, many of which may name the same file.
};

}  // namespace etendue
