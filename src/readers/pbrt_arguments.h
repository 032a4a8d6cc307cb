#pragma once
// The parameters of one pbrt directive, `"type name" [values]`, checked against the table of what it names.

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "color/rgb.h"
#include "description/params.h"
#include "readers/pbrt_tokenizer.h"

namespace etendue {

enum class PbrtVersion { V3 = 1, V4 = 2 };
/// For tables: bits of PbrtVersion.
constexpr int kV3 = 1, kV4 = 2, kV3And4 = kV3 | kV4;

enum class PbrtType {
    Bool,
    Integer,
    Float,
    String,
    Texture,
    Point2,  ///< or vector2
    Vector,  ///< point3, vector3, normal
    Rgb,
    Xyz,
    Blackbody,
    Spectrum  ///< names and files in `strings`, or wavelengths and values in `numbers`
};

struct PbrtValue {
    PbrtType type;
    std::string name;
    PbrtPlace where;
    std::vector<float> numbers;
    std::vector<int> integers;  ///< of Integer and Bool
    std::vector<std::string> strings;
    bool is_default = false;  ///< Of Attribute, for whatever has such a parameter.

    size_t size() const { return numbers.size() + integers.size() + strings.size(); }
};

/// No directive has more parameters than this.
constexpr size_t kMostPbrtValues = 256;

/// Reads the parameters up to the next directive.
std::vector<PbrtValue> read_pbrt_values(PbrtTokenizer& in);

struct PbrtParamInfo {
    std::string_view name;
    ParamKind kind;
    const char* fallback;
    const char* doc;
    int versions = kV3And4;
};

class PbrtArguments;
class PbrtScene;

/// What a directive may name: `Shape "sphere"`, `Material "matte"`, ...
struct PbrtEntry {
    std::string_view name;
    int versions;
    const char* doc;  ///< What it becomes; of one without `make` the reason.
    std::vector<PbrtParamInfo> params;
    /// Adds it to the scene and returns the object made, -1 where there is none. nullptr: it is rejected.
    int (*make)(PbrtScene& scene, const PbrtArguments& args);
};

/// How a spectrum becomes a colour.
enum class PbrtSpectrum { Illuminant, Albedo, Unbounded };

class PbrtArguments {
public:
    PbrtArguments() = default;
    PbrtArguments(std::string kind, std::string name, PbrtPlace where,
                  std::vector<PbrtValue> values)
        : kind_(std::move(kind)), name_(std::move(name)), where_(where),
          values_(std::move(values)) {}

    /// Of the directive: "Shape", and the name that follows it.
    const std::string& kind() const { return kind_; }
    const std::string& name() const { return name_; }
    PbrtPlace where() const { return where_; }
    const std::vector<PbrtValue>& values() const { return values_; }

    /// Drops what the table does not have, after `reject` was told unless it is a default; throws where a type does not fit.
    void check(const PbrtEntry& entry, PbrtVersion version,
               const std::function<void(const SourceLocation&, const std::string& what,
                                        const std::string& more)>& reject);
    /// Adds parameters that hold unless they are given already.
    void add_defaults(const std::vector<PbrtValue>& values);

    bool has(std::string_view name) const { return find(name) != nullptr; }
    const PbrtValue* find(std::string_view name) const;
    bool flag(std::string_view name, bool fallback) const;
    int integer(std::string_view name, int fallback, int lo, int hi) const;
    float number(std::string_view name, float fallback, float lo = -kInf, float hi = kInf) const;
    std::string text(std::string_view name, std::string_view fallback) const;
    Vec3 vector(std::string_view name, Vec3 fallback) const;
    /// As many numbers as are given, a multiple of `group`; empty where the parameter is absent.
    const std::vector<float>& numbers(std::string_view name, size_t group) const;
    const std::vector<int>& integers(std::string_view name) const;

    [[noreturn]] void fail(const std::string& message) const;
    [[noreturn]] void fail(std::string_view name, const std::string& message) const;

private:
    const PbrtValue* find_one(std::string_view name) const;

    std::string kind_, name_;
    PbrtPlace where_;
    std::vector<PbrtValue> values_;
};

}  // namespace etendue
