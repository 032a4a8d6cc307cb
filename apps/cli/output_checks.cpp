#include "output_checks.h"

#include <filesystem>
#include <stdexcept>

#include <fmt/format.h>

#include "integrator/integrator.h"
#include "system/output_file.h"
#include "system/section_file.h"

namespace etendue {

namespace fs = std::filesystem;

void refuse_same_file(const char* one, const std::string& file, const char* other,
                      const std::string& other_file) {
    if (file.empty() || other_file.empty() || !are_one_file(file, other_file)) return;
    throw std::runtime_error(
        fmt::format("the {} and the {} cannot be the same file: {}", one, other, other_file));
}

void refuse_user_paths(const std::string& integrator, const char* output, const std::string& file) {
    const IntegratorSpec spec = IntegratorSpec::parse(integrator);
    if (const auto paths = spec.params.find("user_paths"); paths != spec.params.end())
        refuse_same_file("file of user paths", paths->second, output, file);
}

bool replaces_checkpoint(const std::string& file) {
    std::error_code error;
    if (!fs::is_regular_file(file, error) || fs::file_size(file, error) == 0) return false;
    if (SectionReader::is_one(file)) return true;
    throw std::runtime_error(
        fmt::format("{} is not replaced by a checkpoint, since it is none", file));
}

}  // namespace etendue
