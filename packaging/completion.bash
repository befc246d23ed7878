# Completion for supertac and its programs, asked of the programs themselves.
_supertac() {
  local word=${COMP_WORDS[COMP_CWORD]} program=$1
  if [ "${1##*/}" = supertac ]; then
    if [ "$COMP_CWORD" -eq 1 ] || [ "${COMP_WORDS[1]} $COMP_CWORD" = "help 2" ]; then
      mapfile -t COMPREPLY < <(compgen -W "help $("$1" --help | sed -n 's/^  \([a-z]\+\)  .*/\1/p')" -- "$word")
      return
    fi
    program=$1-${COMP_WORDS[1]}
  fi
  case $word in
    -*) mapfile -t COMPREPLY < <(compgen -W "$("$program" --help | grep -o -- '^ *\(-h, \)\?--[a-z-]*' | tr -d ' ,')" -- "$word") ;;
    *) mapfile -t COMPREPLY < <(compgen -f -- "$word") ;;
  esac
}
complete -o filenames -F _supertac supertac supertac-check supertac-check-gradients supertac-classify supertac-collect supertac-evaluate \
  supertac-export supertac-import supertac-info supertac-plate supertac-rig supertac-simulate supertac-stream \
  supertac-sweep supertac-train
