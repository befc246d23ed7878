# Run by CPack before it packs: folders have the same permissions whatever the umask of whoever builds. Not by
# file(CHMOD_RECURSE): the link libsupertac.so of one package leads to a file of the other.
execute_process(COMMAND find "${CPACK_TEMPORARY_DIRECTORY}" -type d -exec chmod 755 {} + COMMAND_ERROR_IS_FATAL ANY)
