#include "readers/xml_entities.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "readers/mitsuba_values.h"

namespace etendue {
namespace {

// Entities may contain others, so that their text could grow exponentially.
constexpr size_t kMostCharacters = size_t(16) << 20;
constexpr size_t kCostOfReference = 16;  // in characters, since empty ones take time as well
constexpr int kDeepest = 32;
constexpr size_t kLongestReference = 1024;  // as other names of a scene

struct Entity {
    std::string value;
    bool is_external = false;  ///< The value is the name of a file.
};
using Entities = std::map<std::string, Entity, std::less<>>;

/// Reads the declarations of a document type.
class Declarations {
public:
    explicit Declarations(std::string_view text) : rest_(text) {}

    Entities read() {
        Entities found;
        constexpr std::string_view kBegin = "<!ENTITY";
        while (!rest_.empty()) {
            if (skip_section("<!--", "-->") || skip_section("<?", "?>")) continue;
            if (rest_.front() == ']') break;
            if (!rest_.starts_with(kBegin)) {
                if (rest_.front() == '"' || rest_.front() == '\'')
                    quoted();
                else
                    rest_.remove_prefix(1);
                continue;
            }
            rest_.remove_prefix(kBegin.size());
            const std::string_view name = word();
            if (name == "%") continue;  // a parameter entity, for document types only
            Entity entity;
            skip_blanks();
            entity.is_external = rest_.starts_with("SYSTEM") || rest_.starts_with("PUBLIC");
            if (rest_.starts_with("PUBLIC")) word(), quoted();
            if (rest_.starts_with("SYSTEM")) word();
            entity.value = quoted();
            // The places where it stands keep their lines.
            std::replace_if(
                entity.value.begin(), entity.value.end(),
                [](char c) { return c == '\n' || c == '\r'; }, ' ');
            found.try_emplace(std::string(name), std::move(entity));  // the first one is valid
        }
        return found;
    }
    /// After read(): what follows the declarations.
    std::string_view rest() const { return rest_; }

private:
    static constexpr std::string_view kBlanks = " \t\r\n";

    bool skip_section(std::string_view begin, std::string_view end) {
        if (!rest_.starts_with(begin)) return false;
        const size_t at = rest_.find(end, begin.size());
        rest_.remove_prefix(at == rest_.npos ? rest_.size() : at + end.size());
        return true;
    }
    void skip_blanks() {
        rest_.remove_prefix(std::min(rest_.find_first_not_of(kBlanks), rest_.size()));
    }
    std::string_view word() {
        skip_blanks();
        const size_t end = std::min(rest_.find_first_of(" \t\r\n>\"'"), rest_.size());
        const std::string_view found = rest_.substr(0, end);
        rest_.remove_prefix(end);
        return found;
    }
    std::string quoted() {
        skip_blanks();
        if (rest_.empty() || (rest_.front() != '"' && rest_.front() != '\'')) return {};
        const size_t end = rest_.find(rest_.front(), 1);
        const std::string value(rest_.substr(1, end == rest_.npos ? rest_.npos : end - 1));
        rest_.remove_prefix(end == rest_.npos ? rest_.size() : end + 1);
        return value;
    }

    std::string_view rest_;
};

class Expander {
public:
    using Where = std::function<SourceLocation(size_t)>;

    Expander(const Entities& entities, std::string& out) : entities_(entities), out_(out) {}

    /// Appends `text`, in which comments and CDATA stay as they are. `where` gives the place of an offset in it; depth
    /// 0 is the file itself.
    void append(std::string_view text, const Where& where, int depth) {
        for (size_t at = 0; at < text.size();) {
            const std::string_view rest = text.substr(at);
            size_t length = 0;
            if (rest.front() == '&') length = reference(rest, where, at, depth);
            if (length == 0) {
                length = rest.starts_with("<!--")        ? through(rest, "-->")
                         : rest.starts_with("<![CDATA[") ? through(rest, "]]>")
                                                         : rest.find_first_of("&<", 1);
                length = std::min(length, rest.size());
                if (depth > 0) spend(length, where, at);
                out_ += rest.substr(0, length);
            }
            at += length;
        }
    }

private:
    static size_t through(std::string_view text, std::string_view end) {
        const size_t at = text.find(end);
        return at == text.npos ? text.size() : at + end.size();
    }
    /// Counts what comes from entities.
    void spend(size_t characters, const Where& where, size_t at) {
        spent_ += characters;
        if (spent_ > kMostCharacters)
            throw SceneError(where(at),
                             fmt::format("the entities of the file stand for more than {} "
                                         "characters",
                                         kMostCharacters));
    }
    /// Characters of a reference to an entity that is declared, after its text was appended; 0 for other text.
    size_t reference(std::string_view text, const Where& where, size_t at, int depth) {
        // Ampersands that begin no reference must not each be followed to the end of the text.
        const size_t end = text.substr(0, kLongestReference).find(';');
        if (end == text.npos) return 0;
        const auto it = entities_.find(text.substr(1, end - 1));
        if (it == entities_.end()) return 0;
        const auto& [name, entity] = *it;
        spend(kCostOfReference, where, at);
        if (entity.is_external)
            throw SceneError(where(at),
                             fmt::format("the entity {} stands for the file {}: entities in other "
                                         "files are not read (<include> reads files that are "
                                         "scenes or objects)",
                                         quote(name), quote(entity.value)));
        if (depth >= kDeepest)
            throw SceneError(where(at), fmt::format("the entity {} contains itself, or entities "
                                                    "are nested more than {} deep",
                                                    quote(name), kDeepest));
        append(
            entity.value, [&](size_t) { return where(at); }, depth + 1);
        return end + 1;
    }

    const Entities& entities_;
    std::string& out_;
    size_t spent_ = 0;
};

}  // namespace

std::optional<std::string> expand_entities(std::string_view text, const FileName& file,
                                           const std::function<int(size_t)>& line) {
    const size_t type = text.find("<!DOCTYPE");
    if (type == text.npos) return {};
    const size_t bracket = text.find_first_of("[>", type);
    if (bracket == text.npos || text[bracket] != '[') return {};
    Declarations declarations(text.substr(bracket + 1));
    const Entities entities = declarations.read();
    if (entities.empty()) return {};
    const size_t body = text.size() - declarations.rest().size();
    std::string out(text.substr(0, body));
    Expander(entities, out)
        .append(
            text.substr(body),
            [&](size_t at) {
                return SourceLocation{file, line(body + at)};
            },
            0);
    return out;
}

}  // namespace etendue
